"""A server that is busy: every request waits as it says, and none is lost."""

import contextlib
import http.client
import pickle
import threading
import unittest
from collections import Counter
from unittest import mock

import isomesh_client
import numpy
from isomesh_client import busy
from isomesh_client.stopping import Stop
from limits import LimitedTest
from support import DaemonTest, FakeServer, ball

NEVER = 10**9


class Clock:
    """Sleeping takes no time, and is recorded."""

    def __init__(self, interrupts=()):
        self.now = 1000.0
        self.pauses = []
        self.interrupts = list(interrupts)

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        self.pauses.append(seconds)
        self.now += seconds
        if self.interrupts:
            raise self.interrupts.pop()

    @contextlib.contextmanager
    def installed(self):
        with mock.patch.object(busy, "time", self), mock.patch.object(Stop, "pause", lambda _, seconds: self.sleep(seconds)):
            yield


class BusyServer(FakeServer):
    """Rejects the first `refusals` requests of each method and path, and passes all others on to the
    daemon at `url`."""

    def __init__(self, url="", refusals=1, status=429, headers=None):
        self.url_of_daemon, self.refusals, self.status = url, refusals, status
        self.told = {"Retry-After": "7"} if headers is None else headers
        self.refused, self.seen = Counter(), []
        super().__init__(self.respond)

    def respond(self, request, body):
        # The body of a large upload says nothing here, and its offset does.
        sent = (request.command, request.path, request.headers.get("Upload-Offset"))
        self.seen.append((*sent, request.headers.get("Idempotency-Key"), body))
        if self.refused[sent] < self.refusals:
            self.refused[sent] += 1
            problem = {**self.told, "Content-Type": "application/problem+json"}
            return self.status, problem, b'{"title": "Busy", "detail": "come again"}'
        daemon = http.client.HTTPConnection(self.url_of_daemon.removeprefix("http://"), timeout=60)
        with contextlib.closing(daemon):
            daemon.request(request.command, request.path, body, dict(request.headers))
            response = daemon.getresponse()
            return response.status, dict(response.getheaders()), response.read()


class RetryAfter(LimitedTest):
    def test_its_forms(self):
        date = "Sat, 28 Nov 2026 09:40:00 GMT"
        for value, seconds in (
            ("0", 0),
            ("7", 7),
            (" 120 ", 120),
            ("1.5", 1.5),
            ("Sat, 28 Nov 2026 09:41:30 GMT", 90),
            ("Saturday, 28-Nov-26 09:41:30 GMT", 90),
            ("Sat Nov 28 09:41:30 2026", 90),
            ("Sat, 28 Nov 2026 09:39:00 GMT", 0),
            ("", None),
            ("soon", None),
            ("-5", None),
            ("nan", None),
            ("Sat, 99 Nov 99999 99:99:99 GMT", None),
        ):
            self.assertEqual(busy.retry_after(value, date), seconds, value)

    def test_a_date_is_compared_with_this_machines_clock_if_the_response_has_none(self):
        self.assertEqual(busy.retry_after("Thu, 01 Jan 1970 00:00:00 GMT", ""), 0)
        self.assertGreater(busy.retry_after("Fri, 31 Dec 9999 23:59:59 GMT", "yesterday"), 1e9)

    def test_clients_that_were_rejected_together_return_apart(self):
        for asked, latest in ((1, 1.5), (40, 50)):
            clock, excused = Clock(), []
            with clock.installed():
                for _ in range(200):
                    busy.Patience(100, clock.sleep).wait(isomesh_client.Refused(503, {}, asked), excused.append)
            self.assertEqual(excused, clock.pauses)
            self.assertTrue(all(asked <= pause <= latest for pause in clock.pauses))
            self.assertGreater(max(clock.pauses) - min(clock.pauses), (latest - asked) / 2)

    def test_pauses_grow_if_the_server_does_not_say(self):
        clock = Clock()
        patience = busy.Patience(600, clock.sleep)
        with clock.installed(), self.assertRaises(isomesh_client.Refused):
            for _ in range(NEVER):
                patience.wait(isomesh_client.Refused(429, {}), lambda _: None)
        for pause, longest in zip(clock.pauses, (0.5, 1, 2, 4, 8, 15, 15, 15)):
            self.assertTrue(longest / 2 <= pause <= longest, clock.pauses)
        self.assertTrue(570 < sum(clock.pauses) <= 600, clock.pauses)


class Limits(LimitedTest):
    def assert_rejected(self, server, clock, **options):
        with clock.installed(), self.assertRaises(isomesh_client.Refused) as caught:
            isomesh_client.Client(server.url, **options).job("7")
        return caught.exception

    def test_it_waits_for_ten_minutes(self):
        clock = Clock()
        with BusyServer(refusals=NEVER) as server:
            error = self.assert_rejected(server, clock)
        self.assertEqual((error.status, error.retry_after, str(error)), (429, 7, "come again"))
        self.assertTrue(590 < sum(clock.pauses) <= 600, clock.pauses)
        self.assertTrue(all(7 <= pause <= 8.75 for pause in clock.pauses))
        self.assertEqual(len(server.seen), len(clock.pauses) + 1)

    def test_its_limit_can_be_set(self):
        for seconds, tries in ((0, 1), (6, 1), (20, 3)):
            clock = Clock()
            with BusyServer(refusals=NEVER, status=503) as server:
                with mock.patch.object(busy.random, "uniform", lambda low, high: high):
                    self.assert_rejected(server, clock, retry_seconds=seconds)
                self.assertEqual(len(server.seen), tries)

    def test_it_does_not_begin_to_wait_for_what_comes_too_late(self):
        clock = Clock()
        with BusyServer(refusals=NEVER, headers={"Retry-After": "3600"}) as server:
            self.assertEqual(self.assert_rejected(server, clock).retry_after, 3600)
        self.assertEqual(clock.pauses, [])

    def test_a_date(self):
        clock = Clock()
        told = {"Retry-After": "Sat, 28 Nov 2026 09:41:30 GMT", "Date": "Sat, 28 Nov 2026 09:41:00 GMT"}
        with BusyServer(refusals=NEVER, headers=told) as server:
            self.assertEqual(self.assert_rejected(server, clock, retry_seconds=60).retry_after, 30)
        self.assertTrue(30 <= clock.pauses[0] <= 37.5)

    def test_other_errors_are_not_retried(self):
        for status in (400, 404, 409, 410, 413, 422, 500, 502, 507):
            clock = Clock()
            with BusyServer(refusals=NEVER, status=status) as server:
                self.assertEqual(self.assert_rejected(server, clock).status, status)
            self.assertEqual((len(server.seen), clock.pauses), (1, []))

    def test_an_interrupt_ends_the_wait(self):
        clock = Clock(interrupts=[KeyboardInterrupt])
        with BusyServer(refusals=NEVER) as server:
            with clock.installed(), self.assertRaises(KeyboardInterrupt):
                isomesh_client.Client(server.url).job("7")
        self.assertEqual(len(server.seen), 1)

    def test_waiting_for_a_job_ends_at_its_timeout(self):
        clock = Clock()
        with BusyServer(refusals=NEVER) as server:
            with clock.installed(), self.assertRaises(TimeoutError):
                isomesh_client.Client(server.url).wait("7", timeout=30)
        self.assertTrue(20 < sum(clock.pauses) <= 30, clock.pauses)

    def test_a_limit_that_is_none(self):
        for seconds in (-1, float("nan"), float("inf")):
            with self.assertRaisesRegex(ValueError, "retry_seconds"):
                isomesh_client.Client("http://127.0.0.1:1", retry_seconds=seconds)


class Everything(DaemonTest):
    def test_every_request_waits_and_is_repeated_as_it_was(self):
        big = numpy.zeros((256, 256, 160), numpy.uint8)  # is sent in parts
        big[100:130, 100:130, 60:90] = 1
        clock = Clock()
        with BusyServer(self.url) as server, clock.installed():
            client = isomesh_client.Client(server.url)
            volume = client.upload(ball())
            client.erase(client.upload(ball() - 1))
            mesh = client.mesh(big, labels=[1], formats=["glb"])
            client.download(mesh.job, self.folder / "one.glb")
            self.assertEqual(len(client.fetch(mesh.job["id"]).faces), len(mesh.faces))
            client.cancel(client.submit(volume, iso=-4))
            client.rename(volume, "ball")
            self.assertEqual(client.volume(volume)["name"], "ball")
            self.assertIn(volume["id"], [each["id"] for each in client.volumes()])
            self.assertIn(mesh.job["id"], [each["id"] for each in client.jobs()])
            client.histogram(volume)
            client.labels(mesh.job["volume"])
            client.estimate(volume, iso=-4)
            self.assertEqual(len(list(client.job_labels(mesh.job))), 1)
            self.assertEqual(len(list(client.job_walls(mesh.job))), 1)
        self.assertGreater(len(server.refused), 15)
        self.assertEqual(len(clock.pauses), len(server.refused))
        self.assertTrue(all(7 <= pause <= 8.75 for pause in clock.pauses))
        jobs = [(key, body) for method, path, _, key, body in server.seen if (method, path) == ("POST", "/v1/jobs")]
        # The first of them was rejected. A job has one key, and no other job has it.
        self.assertEqual(len(jobs), 3)
        self.assertEqual(jobs[0], jobs[1])
        self.assertNotEqual(jobs[1][0], jobs[2][0])
        methods = [method for method, path, *_ in server.seen if path.startswith("/v1/uploads/")]
        self.assertEqual(methods, ["PATCH", "PATCH"])

    def test_an_interrupt_of_a_wait_leaves_no_job(self):
        volume = self.client.upload(numpy.random.default_rng(1).random((128, 128, 96), "float32"))
        clock = Clock(interrupts=[KeyboardInterrupt])
        with BusyServer(self.url, headers={"Retry-After": "1"}) as server, clock.installed():
            with self.assertRaises(KeyboardInterrupt):
                isomesh_client.Client(server.url).mesh(volume, iso=0.5, passes=1000)
        with self.assertRaisesRegex(isomesh_client.JobFailed, "cancelled"):
            self.client.wait(next(iter(self.client.jobs())))

    def test_a_client_goes_to_another_process(self):
        other = pickle.loads(pickle.dumps(self.client))
        self.assertEqual(len(list(other.volumes())), len(list(self.client.volumes())))

    def test_an_interrupt_does_not_wait_long_for_a_server_that_stays_busy(self):
        clock = Clock(interrupts=[KeyboardInterrupt])
        with BusyServer(refusals=NEVER, headers={"Retry-After": "1"}) as server, clock.installed():
            with self.assertRaises(KeyboardInterrupt):
                isomesh_client.Client(server.url).mesh({"id": "a" * 64, "notes": []}, iso=-7)
        self.assertTrue(1 <= sum(clock.pauses[1:]) <= 2, clock.pauses)


class Crowd(DaemonTest):
    """More uploads at once than a client has places: half of two."""

    options = ("--upload-places", "2")
    crowd = 10

    @contextlib.contextmanager
    def place_taken(self):
        """An upload that takes the place until the context calls what it gets."""
        with contextlib.closing(http.client.HTTPConnection(self.url.removeprefix("http://"))) as other:
            other.putrequest("POST", "/v1/volumes")
            other.putheader("Content-Length", "10000000")
            other.putheader("Expect", "100-continue")
            other.endheaders()
            self.assertIn(b" 100 ", other.sock.recv(1000))  # it has the place
            yield other.close

    def test_threads(self):
        sizes = {}

        def mesh(number):
            sizes[number] = len(self.client.mesh(ball((64, 64, 64)) + number, iso=number - 20).faces)

        with self.place_taken() as release, self.assertLogs("isomesh_client", "INFO") as waits:
            threads = [threading.Thread(target=mesh, args=(number,)) for number in range(self.crowd)]
            for thread in threads:
                thread.start()
            while not waits.output and any(thread.is_alive() for thread in threads):
                threads[0].join(0.01)
            release()
            for thread in threads:
                thread.join()
        self.assertEqual(len(sizes), self.crowd)
        self.assertIn("the server is busy", waits.output[0])


if __name__ == "__main__":
    unittest.main()
