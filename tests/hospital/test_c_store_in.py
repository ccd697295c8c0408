"""Series that others send by C-STORE."""
import json
import os
import re
import select
import signal
import socket
import subprocess
import time

import dicom
import peers
import scu
from fixture import Receiver

class Receiving(Receiver):
    def test_received(self):
        """A series becomes an order by the rule of the title that it was sent to, and goes then."""
        series, folder = self.made()
        daemon = self.receiver()
        # The PACS has the study too, as usual: the router sends to both.
        self.pacs.upload(series.files.values())
        self.send(daemon, self.in_folder(folder))
        order = self.succeeded(daemon, self.only_order(daemon, series))
        self.assertEqual((order["rule"], order["source"]["pacs"], order["source"]["instances"]),
                         ("bone", "dimse:BONE", 12))
        self.assert_one_mesh(order, series)
        self.assertEqual([path for method, path in self.proxy.requests
                          if "/instances?includefield=00080018" in path],
                         [])
        # What was received is not kept.
        peers.until(lambda: not self.received(daemon))
        transfers = [each for each in daemon.audit() if each["event"] == "110104"]
        self.assertEqual([(each["direction"], each["instances"], each.get("patient_id"),
                           each.get("peer"), each.get("calling")) for each in transfers],
                         [("in", 12, None, "127.0.0.1", "CT1"),
                          ("in", 12, "PAT-4711", None, None), ("out", 1, "PAT-4711", None, None)])
        for secret in (series.study, series.uid, series.instances[0], "PAT-4711"):
            self.assertNotIn(secret, daemon.logged())

    def test_syntaxes(self):
        """All syntaxes that can be read are accepted, with those that DCMTK has no name for."""
        daemon = self.receiver()
        for syntax, accepted in [
                ("1.2.840.10008.1.2.4.201", True), ("1.2.840.10008.1.2.4.202", True),
                ("1.2.840.10008.1.2.4.203", True), ("1.2.840.10008.1.2.4.110", True),
                ("1.2.840.10008.1.2.4.111", True), ("1.2.840.10008.1.2.4.112", True),
                ("1.2.840.10008.1.2.8.1", True), ("1.2.840.10008.1.2.4.102", False)]:
            peer = scu.Scu(daemon.dimse_port, syntax=syntax)
            self.assertEqual(peer.has_context, accepted, syntax)
            self.assertTrue(peer.release())
        series, _ = self.made()
        self.pacs.upload(series.files.values())
        peer = scu.Scu(daemon.dimse_port, syntax=dicom.ENCAPSULATED)
        for instance, file in series.files.items():
            self.assertEqual(peer.store(instance, dicom.encapsulated(file)), 0)
        self.assertTrue(peer.release())
        order = self.succeeded(daemon, self.only_order(daemon, series))
        self.assert_one_mesh(order, series)

    def test_replaced(self):
        """An image that is sent again with other contents leaves no former file."""
        _, folder = self.made()
        daemon = self.receiver(settle=3600)
        files = self.in_folder(folder)
        self.send(daemon, files)
        before = self.received(daemon)
        for path in files:
            with open(path, "rb") as file:
                data = file.read()
            self.assertIn(b"PAT-4711", data)
            with open(path, "wb") as file:
                file.write(data.replace(b"PAT-4711", b"PAT-4712"))
        self.send(daemon, files)
        now = self.received(daemon)
        self.assertEqual((len(before), len(now)), (12, 12))
        self.assertFalse(set(before) & set(now))

    def test_orthanc_sends(self):
        """A PACS that sends a series by itself gets the mesh back."""
        series = self.series()
        daemon = self.receiver()
        modality = json.dumps({"AET": "BONE", "Host": "127.0.0.1", "Port": daemon.dimse_port})
        self.assertEqual(self.pacs.call("PUT", "/modalities/isomesh", modality)[0], 200)
        found = json.loads(self.pacs.call("POST", "/tools/lookup", series.uid)[2])[0]["ID"]
        self.assertEqual(self.pacs.call("POST", "/modalities/isomesh/echo", "{}")[0], 200)
        self.assertEqual(self.pacs.call("POST", "/modalities/isomesh/store", found)[0], 200)
        order = self.succeeded(daemon, self.only_order(daemon, series))
        self.assertEqual(order["source"]["instances"], 12)
        self.assert_one_mesh(order, series)

    def test_echo(self):
        daemon = self.receiver()
        subprocess.run(["echoscu", "-aet", "CT1", "-aec", "BONE", "127.0.0.1",
                        str(daemon.dimse_port)], check=True)

    @staticmethod
    def refused(daemon):
        return [each for each in daemon.audit() if each["event"] == "110114"]

    def test_titles(self):
        """Only known titles, on both sides."""
        series, folder = self.made()
        daemon = self.receiver()
        for called, calling, why in [("NOBODY", "CT1", "Called AE Title Not Recognized"),
                                     ("BONE", "STRANGER", "Calling AE Title Not Recognized")]:
            said = self.send(daemon, self.in_folder(folder), called, calling, False)
            self.assertIn(why, said)
            peers.until(lambda: self.refused(daemon))  # written after the answer
        refused = self.refused(daemon)
        # At most one a second has an entry.
        self.assertEqual([(refused[0]["peer"], refused[0]["called"], refused[0]["calling"])],
                         [("127.0.0.1", "NOBODY", "CT1")])
        self.let_all_be_ordered(daemon)
        self.assertEqual(self.of(daemon, series), [])
        self.assertNotIn("STRANGER", daemon.logged())

    def test_sent_twice(self):
        """Within an association, later, and after it has succeeded: one order."""
        series, folder = self.made()
        daemon = self.receiver()
        files = self.in_folder(folder)
        self.send(daemon, files + files)
        self.send(daemon, files)
        self.succeeded(daemon, self.only_order(daemon, series))
        self.send(daemon, files)
        self.let_all_be_ordered(daemon)
        self.only_order(daemon, series)
        peers.until(lambda: not self.received(daemon))
        self.assertEqual(len(self.stored(series)), 1)

    def test_two_titles(self):
        """The same series for two rules: two orders."""
        series, folder = self.made()
        daemon = self.receiver()
        self.send(daemon, self.in_folder(folder))
        self.send(daemon, self.in_folder(folder), "SKIN", "ROUTER")
        orders = peers.until(lambda: (lambda o: o if len(o) == 2 else None)(self.orders(daemon)))
        self.assertEqual({each["rule"] for each in orders}, {"bone", "skin"})
        for each in orders:
            self.succeeded(daemon, each["id"])

    def test_settles(self):
        """An order is made when nothing has come for a while, over several associations."""
        series, folder = self.made()
        daemon = self.receiver(15)  # some hundred times what passes between two of them
        files = self.in_folder(folder)
        for file in files:
            self.send(daemon, [file])
            self.assertEqual(self.orders(daemon), [])
        order = self.succeeded(daemon, self.only_order(daemon, series))
        self.assertEqual(order["source"]["instances"], 12)

    def test_late_slices(self):
        """Slices that come after the mesh wait for the rest: never a mesh of a part."""
        series, folder = self.made()
        daemon = self.receiver()
        files = self.in_folder(folder)
        self.send(daemon, files[:9])
        first = self.only_order(daemon, series)
        self.succeeded(daemon, first)
        peers.until(lambda: not self.received(daemon))
        self.send(daemon, files[9:])
        late = peers.until(lambda: [each for each in self.orders(daemon)
                                    if each["id"] != first and each["attempts"] > 0])[0]
        self.assertEqual(late["error"]["type"], "urn:isomesh:problem:series-incomplete")
        self.assertIn("send the whole series again", late["error"]["detail"])
        self.send(daemon, files)
        late = self.succeeded(daemon, late["id"])
        self.assertEqual(late["source"]["instances"], 12)
        self.assertEqual(len(self.stored(series)), 2)

    def test_after_a_failure(self):
        """A series that made no mesh is tried when it is sent again."""
        series, folder = self.made()
        daemon = self.receiver()
        files = self.in_folder(folder)
        self.send(daemon, files[:5] + files[6:])
        first = daemon.ended(self.only_order(daemon, series))
        self.assertEqual((first["state"], first["error"]["status"]), ("failed", 422))
        peers.until(lambda: not self.received(daemon))
        self.send(daemon, files)
        orders = peers.until(lambda: (lambda o: o if len(o) == 2 else None)(self.orders(daemon)))
        self.succeeded(daemon, orders[0]["id"])

    def test_what_is_no_image_is_not_accepted(self):
        report = dicom.file_of("1.2.840.10008.5.1.4.1.1.88.11", "1.2.3.4", {
            0x00080016: ("UI", "1.2.840.10008.5.1.4.1.1.88.11"), 0x00080018: ("UI", "1.2.3.4"),
            0x0020000D: ("UI", "1.2.3"), 0x0020000E: ("UI", "1.2.3.1")})
        path = os.path.join(self.folder.name, "report.dcm")
        with open(path, "wb") as file:
            file.write(report)
        daemon = self.receiver()
        said = self.send(daemon, [path], check=False)
        self.assertIn("No presentation context", said)

    def test_idle_associations(self):
        """As many as may be that say nothing, or stop in the middle: they hold up nobody for long."""
        series, folder = self.made()
        daemon = self.receiver()
        silent = [socket.create_connection(("127.0.0.1", daemon.dimse_port)) for _ in range(6)]
        for each in silent[:3]:
            each.sendall(b"\x01\x00\x00\x00\x10")
        self.send(daemon, self.in_folder(folder))
        self.succeeded(daemon, self.only_order(daemon, series))
        for each in silent:
            each.close()

    def sent_beside(self, count, greeting, address="127.0.0.1"):
        """Sends a series beside so many connections that send that and no more, and would stay for an hour. Returns how
        many of them had a response by then."""
        _, folder = self.made()
        daemon = self.receiver(idle=3600, associations=8)
        silent = []
        for _ in range(count):
            silent.append(socket.create_connection(("127.0.0.1", daemon.dimse_port),
                                                   source_address=(address, 0)))
            silent[-1].sendall(greeting)
        self.send(daemon, self.in_folder(folder), options=["--acse-timeout", "120"])
        with_response = len(select.select(silent, [], [], 0)[0])
        for each in silent:
            each.close()
        return with_response

    def test_many_begun_requests(self):
        self.sent_beside(300, scu.associate_request()[:20])

    def test_many_silent_associations(self):
        """Those that have sent nothing make room, one after the other."""
        self.assertGreater(self.sent_beside(40, scu.associate_request()), 8)

    def test_silent_associations_of_another_address(self):
        """They have their share of the places, and wait for more behind nobody else."""
        self.assertLess(self.sent_beside(100, scu.associate_request(), "127.0.0.2"), 100)

    def test_slow_request(self):
        """A request has five seconds to come, however long an association may be idle."""
        daemon = self.receiver(idle=3600)
        begun = time.monotonic()
        with socket.create_connection(("127.0.0.1", daemon.dimse_port), timeout=120) as connection:
            connection.sendall(scu.associate_request()[:-1])
            try:
                self.assertEqual(connection.recv(1), b"")
            except ConnectionResetError:
                pass  # what it has sent was not read
        self.assertGreater(time.monotonic() - begun, 4)

    def test_aborted_association(self):
        """What was acknowledged stays, what was not does not count: aborted, cut, left alone."""
        series, folder = self.made()
        daemon = self.receiver(30, 10)
        instances = series.instances

        def begun(number):
            """One object stored, and the next one begun."""
            peer = scu.Scu(daemon.dimse_port)
            self.assertTrue(peer.accepted)
            self.assertEqual(peer.store(instances[number], series.files[instances[number]]), 0)
            peer.command(instances[number + 1])
            peer.values(0, peer.data_set(series.files[instances[number + 1]])[:900])
            return peer
        begun(0).abort()
        begun(2).connection.close()
        left = begun(4)
        self.assertIn(left.receive()[0], (7, None))  # given up after ten seconds
        self.send(daemon, [self.in_folder(folder)[n] for n in (1, 3, 5, 6, 7, 8, 9, 10, 11)])
        order = self.succeeded(daemon, self.only_order(daemon, series))
        self.assertEqual(order["source"]["instances"], 12)

    def test_nonsense(self):
        """Bytes that are no DICOM end one association, and nothing else."""
        series, folder = self.made()
        daemon = self.receiver()
        for length in (1, 10, 1000, 100000):
            # The listener lets only that pass which has the head of a request.
            for data in (os.urandom(length), scu.pdu(1, os.urandom(length))):
                with socket.create_connection(("127.0.0.1", daemon.dimse_port)) as connection:
                    try:
                        connection.sendall(data)
                    except OSError:
                        pass
        # A request that promises four gigabytes.
        with socket.create_connection(("127.0.0.1", daemon.dimse_port)) as connection:
            connection.sendall(b"\x01\x00\xff\xff\xff\xff" + bytes(1000))
            self.send(daemon, self.in_folder(folder))
        self.succeeded(daemon, self.only_order(daemon, series))
        self.assertIsNone(daemon.process.poll())

    def test_mismatch(self):
        """An object that is not what its request says, or that nobody can place, is refused."""
        series, _ = self.made()
        daemon = self.receiver()
        instance = series.instances[0]
        file = series.files[instance]
        peer = scu.Scu(daemon.dimse_port)
        self.assertEqual(peer.store("1.2.3.4.5", file), 0xA900)
        magnetic = dicom.CT_IMAGE_STORAGE[:-1] + "4"
        self.assertEqual(peer.store(instance, file.replace(dicom.CT_IMAGE_STORAGE.encode(),
                                                           magnetic.encode())), 0xA900)
        self.assertEqual(peer.store(instance, file.replace(series.study.encode(), b"x" * len(
            series.study))), 0xA900)
        self.assertIn(peer.store(instance, file[:160] + bytes(range(256)) * 8), (0xA900, 0xC000))
        self.assertEqual(peer.store(instance, file), 0)
        self.assertTrue(peer.release())

    def test_bounds(self):
        """Objects that are too large, and more than may be held, are refused with A700."""
        series, folder = self.made(size=64)
        files = self.in_folder(folder)
        daemon = self.receiver(60, most_object=4000)
        said = self.send(daemon, files[:1], check=False)
        self.assertIn("OutOfResources", said)
        daemon = self.receiver(60, most_held=30_000)
        said = self.send(daemon, files, check=False)
        self.assertEqual(said.count("Received Store Response (Success)"), 3)
        self.assertIn("OutOfResources", said)

    def test_disk_full(self):
        """A full disk answers A700; what was acknowledged is there when there is room again."""
        folder = os.path.join(self.folder.name, "small")
        os.makedirs(folder)
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=48m", "small", folder], check=True)
        try:
            series, files = self.made(size=64)
            files = self.in_folder(files)
            daemon = self.receiver(15, 60, 3, 1 << 30, 1 << 30, "--data", folder)
            self.send(daemon, files[:4])
            filling = os.path.join(folder, "filling")
            peers.fill_disk(filling)
            said = self.send(daemon, files[4:], check=False)
            self.assertNotIn("Received Store Response (Success)", said)
            self.assertIn("OutOfResources", said)
            os.remove(filling)
            peers.until(lambda: peers.call(daemon.port, "GET", "/readyz")[0] == 200)
            self.send(daemon, files[4:])
            order = self.succeeded(daemon, self.only_order(daemon, series))
            self.assertEqual(order["source"]["instances"], 12)
        finally:
            for daemon in self.daemons:
                daemon.kill()
            subprocess.run(["umount", "--lazy", folder], check=True)

    def test_killed_while_receiving(self):
        """kill -9 at any time: what storescu was told is stored is there, and one order comes of it."""
        series, folder = self.made(slices=60)
        daemon = self.receiver(15)  # beyond the starts of the daemon and of storescu
        files = self.in_folder(folder)
        left = files
        for count in (1, 7, 20):
            sending = subprocess.Popen(
                ["storescu", "--no-halt", "--verbose", "--aetitle", "CT1", "--call", "BONE",
                 "--timeout", "5", "127.0.0.1", str(daemon.dimse_port), *left],
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            said = ""
            with sending:
                for line in sending.stdout:
                    said += line
                    if len(self.acknowledged(said)) >= count:
                        daemon.process.send_signal(signal.SIGKILL)
            daemon.process.wait(60)
            daemon.process.stdout.close()
            acknowledged = self.acknowledged(said)
            left = [file for file in left if file not in acknowledged]
            daemon.start()
        if left:
            self.send(daemon, left)
        order = self.succeeded(daemon, self.only_order(daemon, series))
        self.assertEqual(order["source"]["instances"], 60)
        self.assert_one_mesh(order, series)

    @staticmethod
    def acknowledged(said):
        """The files that storescu says were stored."""
        stored = set()
        file = None
        for line in said.splitlines():
            if found := re.search(r"Sending file: (\S+)", line):
                file = found.group(1)
            elif "Received Store Response (Success)" in line and file:
                stored.add(file)
        return stored

    def test_drains(self):
        """SIGTERM ends it also while associations are open, and would be for long."""
        daemon = self.receiver(idle=3600)
        peer = scu.Scu(daemon.dimse_port)
        self.assertTrue(peer.accepted)
        self.assertEqual(daemon.stop(), 0)
        peer.connection.close()
