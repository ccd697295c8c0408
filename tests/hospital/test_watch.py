"""What happens without anybody asking, and who may ask."""
import base64
import os
import subprocess

import dicom
import peers
from fixture import Loop

WATCH = """
[[rules]]
name = "found"
label = "Found"
owner = "radiology"
watch = "main"
match = { modality = "CT", series-description = "*bone*", min-instances = 6, days = 36500 }
parameters = { iso = 500 }
send = [ { pacs = "main" } ]
""".replace("36500", "3650")


class Watch(Loop):
    def orders(self, daemon):
        return daemon.call("GET", "/v1/orders?rule=found")[2]["orders"]

    def let_it_look(self):
        """Two questions that begin from now on: the first has been dealt with before the second."""
        def questions():
            return sum("/series?StudyDate=" in path and path.endswith("offset=0")
                       for _, path in list(self.proxy.requests))
        before = questions()
        peers.until(lambda: questions() >= before + 2)

    def of(self, daemon, series):
        return [each for each in self.orders(daemon) if each["source"]["series"] == series.uid]

    def test_watched(self):
        """A series that a rule is for is ordered once; others are not."""
        right = self.series(description="Head BONE 1mm")
        others = [self.series(description="Head soft"), self.series(slices=5),
                  self.series(modality="MR")]
        daemon = self.daemon(rules=WATCH)
        order = peers.until(lambda: self.of(daemon, right))[0]
        self.succeeded(daemon, order["id"])
        self.let_it_look()
        self.assertEqual(len(self.of(daemon, right)), 1)
        self.assertEqual(len(self.stored(right)), 1)
        for other in others:
            self.assertEqual(self.of(daemon, other), [])
        daemon.kill()
        daemon.start()
        self.let_it_look()
        self.assertEqual(len(self.of(daemon, right)), 1)

    def test_late_slices_after_success(self):
        """Slices that come after the mesh was stored give another order, and another object."""
        series = dicom.Series(self.uid(), slices=12)
        files = list(series.files.values())
        self.pacs.upload(files[:9])
        daemon = self.daemon(settle=6, rules=WATCH)  # beyond the three uploads below
        first = self.succeeded(daemon, peers.until(lambda: self.of(daemon, series))[0]["id"])
        self.pacs.upload(files[9:])
        peers.until(lambda: len(self.of(daemon, series)) == 2)
        late = self.succeeded(daemon, self.of(daemon, series)[0]["id"])
        self.assertEqual((first["source"]["instances"], late["source"]["instances"]), (9, 12))
        self.assertEqual(len(self.stored(series)), 2)
        self.let_it_look()
        self.assertEqual(len(self.of(daemon, series)), 2)


class Search(Loop):
    """A person searches the PACS and orders what is found."""

    def test_a_patient(self):
        patient = f"SEARCH-{self.uid()}"
        series = self.series(patient_id=patient, name="Sucher^Anna")
        self.series(patient_id=patient, name="Sucher^Anna", modality="MR")
        daemon = self.daemon()

        def found(query):
            status, _, body = daemon.call("GET", f"/v1/pacs/main/series?{query}")
            self.assertEqual(status, 200, body)
            self.assertTrue(body["complete"])
            return body["series"]
        row, = found(f"patient_id={patient}&patient_name=such*%5Eanna&modality=CT")
        told = {name: row[name] for name in ("study", "series", "patient_id", "patient_name",
                                             "series_description", "modality", "instances")}
        self.assertEqual(told, {"study": series.study, "series": series.uid, "patient_id": patient,
                                "patient_name": "Sucher^Anna", "series_description": "Head bone",
                                "modality": "CT", "instances": 12})
        self.succeeded(daemon, self.order(daemon, series))
        self.assertEqual(found(f"study={row['study']}"), [row], "without the mesh")
        self.assertEqual(len(found(f"patient_id={patient}")), 2)
        self.assertEqual(found("patient_id=nobody"), [])
        self.assertNotIn(patient, daemon.logged())
        queries = [entry for entry in daemon.audit()
                   if entry["event"] == "110112" and entry.get("patient_id") == patient]
        self.assertEqual({(entry["pacs"], entry["outcome"]) for entry in queries},
                         {("main", "success")})


class Secrets(Loop):
    """HTTPS, Basic and Bearer."""

    def secret(self, text):
        path = os.path.join(self.folder.name, self.uid())
        with open(path, "w", encoding="utf-8") as file:
            file.write(text + "\n")
        return path

    def headers_seen(self, **files):
        seen = []
        real = self.proxy._request

        def request(connection):
            data = connection.recv(65536, 0x2)  # MSG_PEEK
            seen.append(data.decode("latin-1"))
            return real(connection)
        self.proxy._request = request
        return seen

    def test_password(self):
        series = self.series()
        seen = self.headers_seen()
        daemon = self.daemon(pacs=f'user = "me"\npassword-file = "{self.secret("pass word")}"')
        self.succeeded(daemon, self.order(daemon, series))
        wanted = "Authorization: Basic " + base64.b64encode(b"me:pass word").decode()
        seen = [each for each in seen if each]
        self.assertTrue(seen and all(wanted in each for each in seen))

    def test_bearer(self):
        series = self.series()
        seen = self.headers_seen()
        daemon = self.daemon(pacs=f'token-file = "{self.secret("to.ken")}"')
        self.succeeded(daemon, self.order(daemon, series))
        seen = [each for each in seen if each]
        self.assertTrue(seen and all("Authorization: Bearer to.ken" in each for each in seen))
        self.assertNotIn("to.ken", daemon.logged())

    def test_a_secret_that_is_gone_is_an_attempt_that_failed(self):
        series = self.series()
        path = self.secret("to.ken")
        daemon = self.daemon(pacs=f'token-file = "{path}"')
        os.remove(path)
        identity = self.order(daemon, series)
        peers.until(lambda: daemon.get(identity)["attempts"] >= 1)
        self.assertEqual(daemon.call("GET", "/v1/pacs")[2]["pacs"][0]["reason"], "unauthorized")
        with open(path, "w", encoding="utf-8") as file:
            file.write("to.ken\n")
        self.succeeded(daemon, identity)


class Tls(Loop):
    def test_https_with_its_own_authority_and_with_none(self):
        import ssl
        import threading
        folder = self.folder.name
        subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2",
                        "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost",
                        "-keyout", f"{folder}/key.pem", "-out", f"{folder}/cert.pem"],
                       check=True, capture_output=True)
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(f"{folder}/cert.pem", f"{folder}/key.pem")
        plain = self.proxy._one

        def one(connection):
            try:
                plain(context.wrap_socket(connection, server_side=True))
            except (ssl.SSLError, OSError):
                connection.close()
        self.proxy._one = one
        series = self.series()
        text = (f'[orders]\nsettle-seconds = 0\nfirst-delay-seconds = 1\n[[pacs]]\nname = "main"\n'
                f'dicomweb = "https://localhost:{self.proxy.port}/dicom-web"\n{{ca}}\n'
                '[[rules]]\nname = "bone"\nparameters = { iso = 500 }\n'
                'send = [ { pacs = "main" } ]\n')
        from fixture import ISOMESHD
        trusting = peers.Daemon(ISOMESHD, f"{folder}/trusting",
                                text.replace("{ca}", f'ca-file = "{folder}/cert.pem"'))
        self.daemons.append(trusting)
        self.succeeded(trusting, self.order(trusting, series))
        careful = peers.Daemon(ISOMESHD, f"{folder}/careful", text.replace("{ca}", ""))
        self.daemons.append(careful)
        identity = self.order(careful, series)
        peers.until(lambda: careful.get(identity)["attempts"] >= 1)
        self.assertEqual(careful.get(identity)["state"], "waiting")


class Owners(Loop):
    """With tokens, an order and its volume belong to whoever asked."""

    def test_owners(self):
        folder = os.path.join(self.folder.name, "tokens")
        tokens = {}
        for name, role in [("radiology", "user"), ("other", "user"), ("chief", "admin")]:
            said = subprocess.run([os.environ["ISOMESHD"], "token", "add", name, "--role", role, "--into",
                                   folder], check=True, capture_output=True, text=True).stdout
            tokens[name] = {"Authorization": "Bearer " + said.split()[0]}
        series = self.series()
        daemon = self.daemon(None, 0, 2, 500_000_000, 'owners = ["radiology"]', WATCH,
                             "--tokens", folder)
        body = {"source": {"pacs": "main", "study": series.study, "series": series.uid},
                "rule": "found"}
        self.assertEqual(daemon.call("POST", "/v1/orders", body, tokens["other"])[0], 403)
        del body["rule"]
        free = {**body, "parameters": {"iso": 500}, "send": []}
        self.assertEqual(daemon.call("POST", "/v1/orders", free, tokens["other"])[0], 403)
        status, _, order = daemon.call("POST", "/v1/orders", free, tokens["radiology"])
        self.assertEqual(status, 202)
        path = "/v1/orders/" + order["id"]
        self.assertEqual(daemon.call("GET", path)[0], 401)
        self.assertEqual(daemon.call("GET", path, None, tokens["other"])[0], 404)
        self.assertEqual(daemon.call("DELETE", path, None, tokens["other"])[0], 404)
        self.assertEqual(daemon.call("GET", path, None, tokens["chief"])[0], 200)
        ended = peers.until(lambda: (lambda o: o if o["state"] == "succeeded" else None)(
            daemon.call("GET", path, None, tokens["radiology"])[2]))
        self.assertEqual(ended["results"], [])
        for name, status in [("radiology", 200), ("other", 404)]:
            self.assertEqual(
                daemon.call("GET", "/v1/volumes/" + ended["volume"], None, tokens[name])[0], status)
