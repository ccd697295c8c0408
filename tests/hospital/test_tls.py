"""C-STORE over TLS, in both directions, with DCMTK and Orthanc as peers."""
import json
import os
import shutil
import socket
import ssl
import subprocess
import time

import peers
from certificates import Authority
from fixture import DIMSE, Receiver


class Encrypted(Receiver):
    """An Orthanc that receives and sends by TLS only. It, isomesh and the scanner have certificates
    of one authority."""

    @classmethod
    def setUpClass(cls):
        cls.folder = peers.temporary_folder()
        cls.hospital = Authority(cls.folder.name, "hospital")
        cls.other = Authority(cls.folder.name, "other")
        cls.ours = cls.hospital.issue("127.0.0.1")
        cls.scanner = cls.hospital.issue("ct1.example.org")
        certificate, key = cls.hospital.issue("orthanc.example.org")
        cls.port = peers.free_port()
        cls.pacs = peers.Orthanc(os.path.join(cls.folder.name, "pacs"), more={
            "DicomTlsEnabled": True, "DicomTlsCertificate": certificate,
            "DicomTlsPrivateKey": key, "DicomTlsTrustedCertificates": cls.hospital.file,
            "DicomModalities": {"isomesh": {
                "AET": "BONE", "Host": "127.0.0.1", "Port": cls.port, "UseDicomTls": True}}})

    def secured(self, **how):
        """The settings of [dimse] for TLS, before the routes."""
        files = {"certificate": self.ours[0], "key": self.ours[1], "ca": self.hospital.file, **how}
        return "".join(f'{name}-file = "{path}"\n' for name, path in files.items())

    def tls_daemon(self, pacs="", rules="", names='certificate-names = { CT1 = "ct1.example.org" }\n',
                   dimse=None, port=None):
        port = port or peers.free_port()
        text = DIMSE.format(port=port, idle=60, associations=2, most_object=1 << 30,
                            most_held=1 << 30)
        dimse = self.secured() + names if dimse is None else dimse
        daemon = self.daemon(None, 1, 60, 500_000_000, pacs,
                             text.replace("[dimse]\n", "[dimse]\n" + dimse) + rules)
        daemon.dimse_port = port
        return daemon

    def to_orthanc(self, port=None):
        return (f'send-by = "c-store"\nhost = "127.0.0.1"\naet = "ORTHANC"\n'
                f'port = {port or self.pacs.dicom_port}\ntls = true\n'
                f'certificate-name = "orthanc.example.org"\nca-file = "{self.hospital.file}"\n'
                f'certificate-file = "{self.ours[0]}"\nkey-file = "{self.ours[1]}"\n')

    def options(self, identity=None, authority=None):
        """Options of DCMTK's programs."""
        certificate, key = identity or self.scanner
        return ["+tls", key, certificate, "+cf", (authority or self.hospital).file]

    def echo(self, daemon, *options, calling="CT1"):
        said = subprocess.run(
            ["echoscu", "--aetitle", calling, "--call", "BONE", "--timeout", "10", *options,
             "127.0.0.1", str(daemon.dimse_port)], capture_output=True, text=True, check=False)
        return said.returncode == 0

    def test_received_and_sent(self):
        """A scanner sends by TLS, the mesh goes to Orthanc by TLS, and Orthanc sends as the scanner does. After a
        kill and a cut in the middle there is one mesh each."""
        relay = peers.Relay(self.pacs.dicom_port)
        relay.cut_after = 9000  # bytes: after the handshake, in the middle of the object
        daemon = self.tls_daemon(self.to_orthanc(relay.port), port=self.port)
        series, folder = self.made()
        self.pacs.upload(series.files.values())
        self.send(daemon, self.in_folder(folder), options=self.options())
        identity = self.only_order(daemon, series)
        peers.until(lambda: relay.cuts)
        daemon.kill()
        relay.cut_after = None
        daemon.start()
        order = self.succeeded(daemon, identity)
        self.assert_one_mesh(order, series)
        self.assertNotIn("PRIVATE KEY", daemon.logged())
        second = self.series()
        found = json.loads(self.pacs.call("POST", "/tools/lookup", second.uid)[2])[0]["ID"]
        status, _, said = self.pacs.call("POST", "/modalities/isomesh/store", found)
        self.assertEqual(status, 200, said)
        order = self.succeeded(daemon, self.only_order(daemon, second))
        self.assert_one_mesh(order, second)
        relay.close()

    def assert_rejected(self, daemon, sentence, *options, calling="CT1"):
        self.assertFalse(self.echo(daemon, *options, calling=calling))
        peers.until(lambda: sentence in daemon.logged())

    def test_who_may_not_send(self):
        daemon = self.tls_daemon()
        self.assertTrue(self.echo(daemon, *self.options()))
        ct2 = self.options(self.hospital.issue("ct2.example.org"))
        # One rejection a second is logged, and the others are counted.
        self.assert_rejected(daemon, "rejected=certificate-name", *ct2)
        for options in [self.options(self.other.issue("ct1.example.org")), ["+tla", "-ic"],
                        self.options(authority=self.other), []]:
            with self.subTest(options):
                self.assertFalse(self.echo(daemon, *options))
        self.assertFalse(self.echo(daemon, *self.options(), calling="NOBODY"))
        time.sleep(1.1)
        self.assert_rejected(daemon, "the certificate of the peer has expired",
                             *self.options(self.hospital.issue("ct1.example.org", -1)))
        # A title without a name may have any certificate of the authority.
        self.assertTrue(self.echo(daemon, *ct2, calling="ROUTER"))
        failures = [each for each in daemon.audit() if each["event"] == "110114"]
        self.assertEqual(sum(1 + each.get("unlisted", 0) for each in failures), 7)
        self.assertEqual({each["peer"] for each in failures}, {"127.0.0.1"})

    def test_tls_at_a_plain_port(self):
        daemon = self.tls_daemon(dimse="")
        self.assert_rejected(daemon, "it uses TLS, but [dimse] has no certificate-file", *self.options())
        self.assertTrue(self.echo(daemon))

    def test_without_certificates_of_peers(self):
        """Without ca-file, TLS encrypts, and titles are all that is checked."""
        ours = {"certificate": self.ours[0], "key": self.ours[1]}
        daemon = self.tls_daemon(dimse="".join(f'{name}-file = "{path}"\n'
                                               for name, path in ours.items()))
        self.assertTrue(self.echo(daemon, "+tla", "+cf", self.hospital.file))

    def test_slow_handshakes_hold_nothing_up(self):
        """Silent ones, and some that stop in the middle, for more places than there are."""
        daemon = self.tls_daemon()
        begun = time.monotonic()
        self.assertTrue(self.echo(daemon, *self.options()))
        usual = time.monotonic() - begun
        slow = [socket.create_connection(("127.0.0.1", daemon.dimse_port)) for _ in range(40)]
        hello = ssl.create_default_context().wrap_bio(ssl.MemoryBIO(), out := ssl.MemoryBIO(),
                                                      server_hostname="x")
        try:
            hello.do_handshake()
        except ssl.SSLWantReadError:
            pass
        first = out.read()
        for number, each in enumerate(slow):
            each.sendall(first[:number % 3 * 100])
        for each in slow[:10]:
            each.sendall(first)
        begun = time.monotonic()
        self.assertTrue(self.echo(daemon, *self.options()))
        self.assertLess(time.monotonic() - begun, 4 + usual)
        for each in slow:
            each.close()

    def test_a_new_certificate(self):
        """Files are read again when they change; those that cannot be used change nothing."""
        files = [os.path.join(self.folder.name, name) for name in ("used.pem", "used.key", "ca.pem")]

        def use(certificate, key, authority):
            for source, target in zip((certificate, key, authority), files):
                shutil.copy(source, target + ".new")
                os.replace(target + ".new", target)

        use(*self.ours, self.hospital.file)
        daemon = self.tls_daemon(dimse=self.secured(certificate=files[0], key=files[1], ca=files[2]))
        another = self.options(self.hospital.issue("ct3.example.org"))
        self.assertTrue(self.echo(daemon, *another))
        # The certificate of a device, in place of its authority's.
        use(*self.ours, self.scanner[0])
        self.assertTrue(self.echo(daemon, *self.options()))
        self.assertFalse(self.echo(daemon, *another))
        use(*self.other.issue("127.0.0.1"), self.hospital.file)
        self.assertFalse(self.echo(daemon, *another))
        with open(files[0], "w", encoding="utf-8") as file:
            file.write("nothing")
        self.assertFalse(self.echo(daemon, *another))
        self.assertIn("are not used", daemon.logged())
        use(*self.ours, self.hospital.file)
        self.assertTrue(self.echo(daemon, *another))

    def test_whom_isomesh_sends_to(self):
        """To storescp, which needs certificates of its peers."""
        wrong = [self.other.issue("127.0.0.1"), self.hospital.issue("127.0.0.1", -1),
                 self.hospital.issue("elsewhere.example.org")]
        ours = f'certificate-file = "{self.ours[0]}"\nkey-file = "{self.ours[1]}"\n'
        strange = self.other.issue("isomesh.example.org")
        tls = "tls = true\n"
        scps = {}
        with socket.create_server(("127.0.0.1", 0)) as silent:
            # The certificate of the PACS (None: it has no TLS; a number: a port), our settings, and what comes of it.
            cases = [("good", self.ours, tls + ours, ""),
                     ("stranger", wrong[0], tls + ours, "from an authority that is not trusted"),
                     ("expired", wrong[1], tls + ours, "has expired"),
                     ("named", wrong[2], tls + ours, "is for another name"),
                     ("any", wrong[2], tls + ours + 'certificate-name = "*"\n', ""),
                     ("alias", wrong[2], tls + ours + 'certificate-name = "elsewhere.example.org"\n', ""),
                     ("plain", None, tls + ours, "not use TLS on this port"),
                     ("secure", self.ours, "", "it may expect TLS"),
                     ("anonymous", self.ours, tls, "refuses the certificate of isomeshd"),
                     ("unknown", self.ours, tls + f'certificate-file = "{strange[0]}"\n'
                      f'key-file = "{strange[1]}"\n', "refuses the certificate of isomeshd"),
                     ("silent", silent.getsockname()[1], tls + ours, "sent nothing for too long")]
            rules = ""
            for name, identity, settings, _ in cases:
                port = identity
                if not isinstance(identity, int):
                    options = self.options(identity) if identity else []
                    scps[name] = peers.StoreScp(os.path.join(self.folder.name, "scp-" + name), *options)
                    port = scps[name].port
                rules += (f'[[pacs]]\nname = "{name}"\nsend-by = "c-store"\naet = "X"\nport = {port}\n'
                          f'host = "127.0.0.1"\ntimeout-seconds = {2 if name == "silent" else 10}\nca-file = "{self.hospital.file}"\n{settings}'
                          f'[[rules]]\nname = "{name}"\nparameters = {{ iso = 500 }}\n'
                          f'send = [ {{ pacs = "{name}" }} ]\n')
            daemon = self.daemon(rules=rules)
            series = self.series()
            orders = {name: self.order(daemon, series, rule=name) for name, *_ in cases}
            for name, _, _, sentence in cases:
                with self.subTest(name):
                    if not sentence:
                        self.succeeded(daemon, orders[name])
                        self.assertEqual(len(scps[name].files()), 1)
                        continue
                    peers.until(lambda: sentence in (daemon.get(orders[name])["error"] or {}).get(
                        "detail", ""), 30)
                    self.assertEqual(daemon.get(orders[name])["state"], "sending")
                    if name in scps:
                        self.assertEqual(scps[name].files(), [])
        for each in scps.values():
            each.kill()
