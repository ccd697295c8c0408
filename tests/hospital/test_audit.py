"""The audit trail over syslog-TLS (IHE ITI-20), to a collector that may be down."""
import contextlib
import os
import select
import socket
import sqlite3
import ssl
import subprocess
import threading
import time
import xml.etree.ElementTree

import peers
from fixture import Loop


class Collector:
    """Takes syslog over TLS (RFC 5425)."""

    def __init__(self, folder, port=None, name="localhost", client=None, slow_s=0, tickets=2):
        """Waits `slow_s` seconds before it looks at a client's certificate."""
        self.folder = folder
        self.port = port or peers.free_port()
        self.client = client
        self.slow_s = slow_s
        self.tickets = tickets
        self.messages = []
        self.certificate = os.path.join(folder, "collector.pem")
        self.key = os.path.join(folder, "collector-key.pem")
        subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2",
                        "-subj", f"/CN={name}", "-addext", f"subjectAltName=DNS:{name}",
                        "-keyout", self.key, "-out", self.certificate],
                       check=True, capture_output=True)
        self.listener = None
        self.connections = []

    def start(self):
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(self.certificate, self.key)
        context.num_tickets = self.tickets
        if self.client:
            context.verify_mode = ssl.CERT_REQUIRED
            context.load_verify_locations(self.client)
        self.listener = socket.create_server(("127.0.0.1", self.port))
        threading.Thread(target=self._serve, args=(self.listener, context), daemon=True).start()
        return self

    def stop(self):
        self.listener.shutdown(socket.SHUT_RDWR)
        self.listener.close()
        for connection in self.connections:
            try:
                connection.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass
            connection.close()
        self.connections = []

    def _serve(self, listener, context):
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            threading.Thread(target=self._one, args=(connection, context), daemon=True).start()

    def _one(self, connection, context):
        try:
            connection = context.wrap_socket(connection, server_side=True, do_handshake_on_connect=False)
            if self.slow_s:
                self._answer_hello(connection)
                time.sleep(self.slow_s)
            connection.do_handshake()
            self.connections.append(connection)
            stream = connection.makefile("rb")
            while True:
                length = b""
                while not length.endswith(b" "):
                    byte = stream.read(1)
                    if not byte:
                        return
                    length += byte
                message = stream.read(int(length))
                if len(message) == int(length):
                    self.messages.append(message.decode("utf-8"))
        except (OSError, ValueError):
            connection.close()

    @staticmethod
    def _answer_hello(connection):
        """Afterwards a client of TLS 1.3 may send, although its certificate was not looked at."""
        connection.setblocking(False)
        while True:
            select.select([connection], [], [])
            try:
                connection.do_handshake()
            except ssl.SSLWantReadError:
                connection.setblocking(True)
                return

    def events(self):
        """Of each message: the code of its event, its type's, and the ids of its objects."""
        found = []
        for message in self.messages:
            head, text = message.split("\ufeff", 1)
            assert head.startswith("<85>1 "), head
            assert head.split(" ")[3] == "isomeshd", head
            root = xml.etree.ElementTree.fromstring(text)
            identification = root.find("EventIdentification")
            kind = identification.find("EventTypeCode")
            found.append((identification.find("EventID").get("csd-code"),
                          None if kind is None else kind.get("csd-code"),
                          [each.get("ParticipantObjectID")
                           for each in root.findall("ParticipantObjectIdentification")]))
        return found


class Syslog(Loop):
    def collector(self, **how):
        folder = os.path.join(self.folder.name, self.uid())
        os.makedirs(folder)
        collector = Collector(folder, **how)
        self.addCleanup(lambda: collector.listener and collector.stop())
        return collector

    def audited(self, collector, more=""):
        return self.daemon(rules=f'[audit]\nsyslog = "tls://localhost:{collector.port}"\n'
                           f'ca-file = "{collector.certificate}"\n{more}\n')

    @staticmethod
    def asked(daemon, query):
        database = f"file:{os.path.join(daemon.data, 'isomesh.sqlite')}?mode=ro"
        with contextlib.closing(sqlite3.connect(database, uri=True)) as records:
            return records.execute(query).fetchone()[0]

    def sent(self, daemon):
        return self.asked(daemon, "SELECT id FROM audit_sent")

    def noted(self, daemon):
        """Waits until the daemon has noted that all has been sent: what is not noted comes again."""
        peers.until(lambda: self.sent(daemon) == self.asked(daemon, "SELECT max(id) FROM audit"))

    def test_every_event_comes(self):
        collector = self.collector().start()
        daemon = self.audited(collector)
        series = self.series()
        self.succeeded(daemon, self.order(daemon, series))
        self.assertEqual(daemon.stop(), 0)
        peers.until(lambda: len(collector.events()) >= 5)  # its thread reads what has come by then
        told = collector.events()
        self.assertEqual([(event, kind) for event, kind, _ in told],
                         [("110100", "110120"), ("110112", None), ("110104", None),
                          ("110104", None), ("110100", "110121")])
        self.assertEqual(told[2][2], [series.study, "PAT-4711"])

    def test_collector_down_then_up(self):
        """What happens meanwhile waits, over kill -9 too, and comes in order, nothing left out."""
        collector = self.collector()
        daemon = self.audited(collector)
        series = self.series()
        self.succeeded(daemon, self.order(daemon, series))
        daemon.kill()
        told = daemon.logged().count("cannot be sent to its collector")
        daemon.start()
        peers.until(lambda: daemon.logged().count("cannot be sent to its collector") > told)
        collector.start()
        peers.until(lambda: len(collector.messages) >= 5)
        self.assertEqual([kind or event for event, kind, _ in collector.events()],
                         ["110120", "110112", "110104", "110104", "110120"])
        self.noted(daemon)
        collector.stop()
        self.succeeded(daemon, self.order(daemon, self.series()))
        collector.start()
        peers.until(lambda: len(collector.messages) >= 8, 90)
        self.assertEqual([kind or event for event, kind, _ in collector.events()[5:]],
                         ["110112", "110104", "110104"])
        self.noted(daemon)
        daemon.kill()
        daemon.start()
        peers.until(lambda: len(collector.messages) >= 9)
        # What it has had does not come again.
        self.assertEqual(collector.events()[8][:2], ("110100", "110120"))

    def test_a_stranger_gets_nothing(self):
        """A collector whose certificate is not the one, or for another name."""
        stranger = self.collector().start()
        known = self.collector()
        daemon = self.daemon(rules=f'[audit]\nsyslog = "tls://localhost:{stranger.port}"\n'
                             f'ca-file = "{known.certificate}"\n')
        other_name = self.collector(name="elsewhere").start()
        other = self.audited(other_name)
        peers.until(lambda: "from an authority that is not trusted" in daemon.logged())
        peers.until(lambda: "is for another name" in other.logged())
        self.assertEqual(stranger.messages + other_name.messages, [])

    def test_a_certificate_of_ours(self):
        ours = self.collector(name="isomesh-1")
        collector = self.collector(client=ours.certificate).start()
        daemon = self.audited(collector, f'certificate-file = "{ours.certificate}"\n'
                              f'key-file = "{ours.key}"')
        peers.until(lambda: collector.messages)
        without = self.audited(collector)
        peers.until(lambda: "cannot be sent to its collector" in without.logged())
        self.assertEqual(len(collector.messages), 1)
        self.assertEqual(daemon.stop(), 0)

    def test_a_rejection_that_comes_late(self):
        """A client of TLS 1.3 sends before the collector has looked at its certificate. That is not lost."""
        ours = self.collector(name="isomesh-1")
        collector = self.collector(client=ours.certificate, slow_s=3).start()
        daemon = self.audited(collector)
        peers.until(lambda: "cannot be sent to its collector" in daemon.logged())
        self.assertEqual(collector.messages, [])
        self.assertEqual(self.sent(daemon), 0)

    def test_a_collector_without_tickets(self):
        collector = self.collector(tickets=0).start()
        daemon = self.audited(collector)
        self.noted(daemon)
        self.assertEqual([kind for _, kind, _ in collector.events()], ["110120"])
