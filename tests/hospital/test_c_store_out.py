"""Meshes that go to the PACS by C-STORE."""
import os
import socket
import subprocess
import threading

import peers
from fixture import Loop


class Sending(Loop):
    def daemon_to(self, port, aet="ORTHANC", timeout=60, more=""):
        """One that asks over DICOMweb, and sends by C-STORE."""
        return self.daemon(timeout=timeout, pacs=f'send-by = "c-store"\nhost = "127.0.0.1"\n'
                           f'aet = "{aet}"\nport = {port}\n{more}')

    def attempted(self, daemon, identity, times=1):
        """The order once sending has failed so often. On a busy machine, fetching may have failed before."""
        before = peers.until(lambda: (lambda o: o if o["state"] == "sending" else None)(daemon.get(identity)), 180)
        return peers.until(lambda: (lambda o: o if o["attempts"] >= before["attempts"] + times else None)(
            daemon.get(identity)), 120)

    def test_sent_by_c_store(self):
        series = self.series()
        daemon = self.daemon_to(self.pacs.dicom_port)
        order = self.succeeded(daemon, self.order(daemon, series))
        self.assertEqual(order["attempts"], 0)
        self.assert_one_mesh(order, series)
        self.assertEqual([path for method, path in self.proxy.requests if method == "POST"], [])
        again = self.succeeded(daemon, self.order(daemon, series))
        self.assertEqual(again["results"], order["results"])
        self.assert_one_mesh(order, series)

    def test_the_object_comes_as_it_was_made(self):
        """The same bytes as over STOW-RS, and valid."""
        series = self.series()
        daemon = self.daemon_to(self.pacs.dicom_port)
        order = self.succeeded(daemon, self.order(daemon, series))
        instance = order["results"][0]["sop_instance_uid"]
        path = os.path.join(self.folder.name, "sent.dcm")
        with open(path, "wb") as file:
            file.write(self.pacs.file(instance))
        said = subprocess.run(["dciodvfy", path], capture_output=True, text=True, check=False)
        self.assertEqual([line for line in said.stderr.splitlines()
                          if line.startswith(("Error", "Warning"))], [])
        mesh = peers.call(daemon.port, "GET", f"/v1/jobs/{order['job']}/mesh.stl")[2]
        with open(path, "rb") as file:
            self.assertEqual(file.read().count(mesh), 1)

    def test_another_aet_is_tried_again(self):
        series = self.series()
        daemon = self.daemon_to(self.pacs.dicom_port, aet="NOBODY")
        order = self.attempted(daemon, self.order(daemon, series), 2)
        self.assertEqual((order["state"], order["error"]["type"]),
                         ("sending", "urn:isomesh:problem:pacs-refused"))
        self.assertEqual(daemon.call("GET", "/v1/pacs")[2]["pacs"][0]["reason"], "unauthorized")
        self.assertEqual(self.stored(series), [])
        self.assertIn("110114", [each["event"] for each in daemon.audit()])

    def test_down_then_up(self):
        series = self.series()
        nobody = peers.free_port()
        daemon = self.daemon_to(nobody)
        identity = self.order(daemon, series)
        order = self.attempted(daemon, identity)
        self.assertEqual(order["error"]["type"], "urn:isomesh:problem:pacs-unreachable")
        daemon.stop()
        with open(daemon.hospital, encoding="utf-8") as file:
            text = file.read().replace(f"port = {nobody}\n", f"port = {self.pacs.dicom_port}\n")
        with open(daemon.hospital, "w", encoding="utf-8") as file:
            file.write(text)
        daemon.start()
        self.assert_one_mesh(self.succeeded(daemon, identity), series)

    def test_association_cut(self):
        """On the way there, and before the answer: it is sent again, or found where it was sent, and is there once."""
        # 300 bytes hold the answer to the request for an association, and not all of that to the object.
        for how, stored in [({"cut_after": 3000}, 0), ({"cut_answer_after": 300}, 1)]:
            with self.subTest(how):
                series = self.series()
                relay = peers.Relay(self.pacs.dicom_port)
                for name, value in how.items():
                    setattr(relay, name, value)
                daemon = self.daemon_to(relay.port)
                identity = self.order(daemon, series)
                peers.until(lambda: relay.cuts, 180)
                self.assertEqual(len(self.stored(series)), stored)
                relay.cut_after = relay.cut_answer_after = None
                order = self.succeeded(daemon, identity)
                self.assertGreaterEqual(order["attempts"], 1)
                self.assert_one_mesh(order, series)
                relay.close()

    def test_peer_that_hangs(self):
        """One that takes connections and says nothing is given up after the timeout."""
        series = self.series()
        with socket.create_server(("127.0.0.1", 0)) as silent:
            daemon = self.daemon_to(silent.getsockname()[1], timeout=3)
            self.attempted(daemon, self.order(daemon, series))
            self.assertEqual(daemon.call("GET", "/v1/pacs")[2]["pacs"][0]["reason"], "timeout")

    def test_peer_that_talks_nonsense(self):
        series = self.series()
        with socket.create_server(("127.0.0.1", 0)) as listener:
            def answer():
                while True:
                    try:
                        connection, _ = listener.accept()
                    except OSError:
                        return
                    connection.recv(65536)
                    connection.sendall(os.urandom(5000))
                    connection.close()
            threading.Thread(target=answer, daemon=True).start()
            daemon = self.daemon_to(listener.getsockname()[1])
            self.attempted(daemon, self.order(daemon, series), 2)
            self.assertEqual(daemon.process.poll(), None)

    def test_without_dicomweb(self):
        """A PACS that cannot be asked is believed; what refuses for now is sent to again."""
        series = self.series()
        folder = os.path.join(self.folder.name, "scp")
        scp = peers.StoreScp(folder, "--refuse")
        try:
            daemon = self.daemon(rules=f"""
[[pacs]]
name = "archive"
send-by = "c-store"
aet = "ARCHIVE"
host = "127.0.0.1"
port = {scp.port}
timeout-seconds = 2
[[rules]]
name = "archived"
parameters = {{ iso = 500 }}
send = [ {{ pacs = "archive" }} ]
""")
            identity = self.order(daemon, series, rule="archived")
            self.attempted(daemon, identity)
            self.assertEqual(scp.files(), [])
            scp.kill()
            scp.start()
            order = self.succeeded(daemon, identity)
            self.assertEqual(len(scp.files()), 1)
            with open(scp.files()[0], "rb") as file:
                self.assertIn(order["results"][0]["sop_instance_uid"].encode(), file.read())
            status, _, problem = daemon.call("POST", "/v1/orders", {
                "source": {"pacs": "archive", "study": series.study, "series": series.uid},
                "rule": "bone"})
            self.assertEqual((status, problem["errors"][0]["field"]), (400, "source.pacs"))
        finally:
            scp.kill()

    def test_implicit_only(self):
        """A peer that knows only the form that every peer has to know gets the object in that."""
        series = self.series()
        scp = peers.StoreScp(os.path.join(self.folder.name, "implicit"), "--implicit")
        try:
            daemon = self.daemon_to(scp.port, more="")
            identity = self.order(daemon, series)
            # It is no Orthanc: the look afterwards does not find it there.
            peers.until(lambda: "does not find it" in (daemon.get(identity)["error"] or {}).get("detail", ""))
            self.assertGreaterEqual(len(scp.files()), 1)
        finally:
            scp.kill()
