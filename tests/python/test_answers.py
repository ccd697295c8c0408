"""Responses of a server that is not ours, and parameters that a query cannot carry."""

import hashlib
import socket
import threading
import time
import unittest
from unittest import mock

import isomesh_client
import numpy
from isomesh_client import errors, transport
from limits import LimitedTest
from support import DaemonTest, FakeServer

PROBLEM = {"Content-Type": "application/problem+json"}


class Answers(LimitedTest):
    def test_a_refusal_of_any_form_is_an_error_of_this_package(self):
        for body in (b'{"detail": 7, "choices": ["x", 1, null]}', b'{"choices": {"a": 1}}', b"[" * 100_000, b"\xff", b"null", b'"x"'):
            with FakeServer(lambda *_: (422, PROBLEM, body)) as server, self.assertRaises(isomesh_client.Refused):
                isomesh_client.Client(server.url).job("7")

    def test_no_text_of_it_controls_the_terminal(self):
        evil = "e\x1b[2J\x9b\x07\r\n\tx"
        plain = "e\ufffd[2J\ufffd\ufffd\ufffd\n\tx"
        refused = isomesh_client.Refused(422, {"detail": evil, "choices": [{"parameter": evil, "value": "", "title": evil}]})
        self.assertEqual(str(refused), f"{plain}\n  {plain}='': {plain}")
        self.assertEqual(refused.problem["detail"], evil)
        job = {"id": "7", "state": "failed", "error": {"detail": evil}}
        self.assertEqual(str(isomesh_client.JobFailed(job)), f"job 7: {plain}")
        with self.assertWarns(isomesh_client.VolumeWarning) as caught:
            errors.warn_of_notes([{"detail": evil, "code": "c"}], evil)
        self.assertEqual(str(caught.warning), f"{plain}: {plain} (c)")
        with socket.create_server(("127.0.0.1", 0)) as listener:

            def answer():
                for _ in range(4):
                    connection, _ = listener.accept()
                    with connection:
                        connection.recv(65536)
                        connection.sendall(b"\x1b[2J\r\n\r\n")

            threading.Thread(target=answer, daemon=True).start()
            with self.assertRaises(isomesh_client.Unreachable) as broken:
                isomesh_client.Client(f"http://127.0.0.1:{listener.getsockname()[1]}").job("7")
        self.assertNotIn("\x1b", str(broken.exception))

    def test_a_response_that_does_not_end_is_wrong(self):
        sent = []

        def respond(handler, _):
            sent.append(handler.path)
            return 200, {}, b"{" + b" " * 300_000

        with FakeServer(respond) as server, mock.patch.object(transport, "_LONGEST_TEXT", 1000):
            with self.assertRaisesRegex(isomesh_client.WrongAnswer, "too long"):
                isomesh_client.Client(server.url).job("7")
        self.assertEqual(len(sent), 1)

    def test_a_mesh_that_is_longer_than_its_job_says_is_not_held(self):
        file = {"bytes": 10, "sha256": hashlib.sha256(bytes(10)).hexdigest(), "href": "/mesh"}
        job = {"id": "7", "state": "succeeded", "volume": "v", "error": None, "mesh": {"empty": False, "files": {"ply": file}}}
        with FakeServer(lambda *_: (200, {}, bytes(1_000_000))) as server:
            with self.assertRaisesRegex(isomesh_client.WrongAnswer, "longer than its job says"):
                isomesh_client.Client(server.url)._fetch(job, ())


class Silence(LimitedTest):
    def test_waiting_for_a_job_ends_soon_after_its_timeout(self):
        over = threading.Event()

        def respond(*_):
            over.wait(60)
            return 200, {}, b""

        with FakeServer(respond) as server:
            began = time.monotonic()
            with self.assertRaisesRegex(TimeoutError, "no retry is left in 0.5 s"):
                isomesh_client.Client(server.url).wait("7", timeout=0.5)
            self.assertLess(time.monotonic() - began, 15)
            over.set()

    def test_the_wait_that_the_server_was_asked_for_is_part_of_the_timeout(self):
        over = threading.Event()

        def respond(*_):
            over.wait(60)
            return 200, {}, b""

        with FakeServer(respond) as server, mock.patch.object(transport.busy, "PARTING_SILENCE", 0.2):
            began = time.monotonic()
            with self.assertRaises(TimeoutError):
                isomesh_client.Client(server.url).wait("7", timeout=4)
            self.assertLess(time.monotonic() - began, 7)
            over.set()

    def test_an_address_without_a_port_has_the_usual_one(self):
        for server, port in (("http://[2001:db8::17]", 80), ("https://[2001:db8::17]", 443), ("http://[2001:db8::17]:9", 9)):
            with mock.patch.object(transport.socket, "getaddrinfo", side_effect=OSError) as asked:
                with self.assertRaises(isomesh_client.Unreachable):
                    isomesh_client.Client(server).job("7")
            self.assertEqual(asked.call_args.args, ("2001:db8::17", port))

    def test_a_server_that_is_not_there_is_told_at_once(self):
        with self.assertRaises(isomesh_client.Unreachable):
            isomesh_client.Client("http://127.0.0.1:1").wait("7", timeout=60)


class Estimates(DaemonTest):
    def test_what_changes_no_number_may_be_given(self):
        samples = numpy.zeros((10, 10, 10), "uint8")
        samples[2:5, 2:5, 2:5], samples[5:8, 5:8, 5:8] = 1, 2
        volume = self.client.upload(samples)
        whole = self.client.estimate(volume, labels="all")
        named = self.client.estimate(volume, labels="all", label_names={1: "one", 2: "two"}, label_colors={1: "#ff0000"})
        self.assertEqual(named["triangles"], whole["triangles"])
        with self.assertRaisesRegex(ValueError, "label_values"):
            self.client.estimate(volume, labels=[50], label_values={50: [1, 2]})


if __name__ == "__main__":
    unittest.main()
