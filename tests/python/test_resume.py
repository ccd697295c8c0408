"""When a large upload is continued, and when it ends."""

import unittest
from types import SimpleNamespace
from unittest import mock

from isomesh_client import resume
from isomesh_client.errors import Refused, Unreachable
from isomesh_client.uploads import Body

PLACE = "/v1/uploads/7"
BODY = Body(1000, lambda: iter([bytes(1000)]))


def answer(**headers):
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    return SimpleNamespace(status=204, header=lambda name: named.get(name, ""), text=lambda: b"")


class Busy(SimpleNamespace):
    """So many seconds of an answer's time pass because the server is busy."""


class Server:
    """Its answers, or the errors of its connections, each with the seconds that it takes."""

    def __init__(self, *answers):
        self.answers = [(0, answer(Location=PLACE)), *answers]
        self.asked = []
        self.now = 0

    def send(self, request, excuse=lambda seconds: None):
        self.asked.append(request.method)
        while isinstance(self.answers[0], Busy):
            busy = self.answers.pop(0).seconds
            excuse(busy)
            self.now += busy
        seconds, result = self.answers.pop(0)
        self.now += seconds
        if isinstance(result, BaseException):
            raise result
        return result

    repeated = send_whole = lambda self, *arguments: self.send(*arguments)

    def parting(self):
        return self

    def pause(self, seconds):
        pass

    def upload(self):
        clock = SimpleNamespace(monotonic=lambda: self.now)
        with mock.patch.object(resume, "time", clock):
            return resume.send(self, "/v1/volumes", {}, BODY)


def progress(offset):
    return 0, answer(Upload_Offset=str(offset), Upload_Complete="?0")


class Resume(unittest.TestCase):
    def test_a_part_that_got_on_for_minutes_before_it_broke(self):
        cut = Unreachable("cut")
        done = answer()
        server = Server((0, cut), progress(0), (90, cut), progress(500), (0, done))
        self.assertIs(server.upload(), done)

    def test_a_minute_without_progress(self):
        server = Server((0, Unreachable("first")), progress(0), (60, Unreachable("last")), progress(0))
        with self.assertRaisesRegex(Unreachable, "last"):
            server.upload()

    def test_the_time_that_a_busy_server_asked_for_is_no_outage(self):
        cut, done = Unreachable("cut"), answer()
        server = Server(Busy(seconds=9), (0, cut), Busy(seconds=300), progress(0), (59, cut), progress(0), (0, done))
        self.assertIs(server.upload(), done)
        server = Server((0, cut), Busy(seconds=300), progress(0), Busy(seconds=300), (60, cut), progress(0))
        with self.assertRaisesRegex(Unreachable, "cut"):
            server.upload()

    def test_somebody_else_cancels_it(self):
        cancelled = Refused(409, {"type": "urn:isomesh:problem:cancelled", "detail": "the upload was cancelled"})
        server = Server((0, Unreachable("cut")), (0, Refused(409, {})), (0, cancelled), (0, Refused(410, {})))
        with self.assertRaisesRegex(Refused, "cancelled"):
            server.upload()
        self.assertEqual(server.asked, ["POST", "PATCH", "HEAD", "GET", "DELETE"])

    def test_an_odd_answer_to_its_end_hides_no_reason(self):
        for text in (b"<html>", b"[]", b'{"volumes": 3}', b'{"volumes": [3]}', b'{"volumes": [{"id": 3}]}', b"[" * 100_000, b"\xff"):
            odd = answer()
            odd.status, odd.text = 200, lambda: text
            for reason in (Refused(413, {}), KeyboardInterrupt()):
                server = Server((0, reason), (0, odd))
                with self.subTest(text=text[:30]), self.assertRaises(type(reason)):
                    server.upload()
                self.assertEqual(server.asked, ["POST", "PATCH", "DELETE"])


if __name__ == "__main__":
    unittest.main()
