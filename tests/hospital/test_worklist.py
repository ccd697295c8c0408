"""Workitems of a worklist (UPS-RS) become orders: claimed once, told of their progress and end."""
import random
import time

import peers
import worklist
from fixture import Loop


class Workitems(Loop):
    def setUp(self):
        super().setUp()
        self.list = worklist.Worklist()

    def tearDown(self):
        super().tearDown()
        self.list.close()

    def performer(self):
        return self.daemon(rules=worklist.RULE.format(port=self.list.port, path=""))

    def scheduled(self, series, **more):
        uid = self.uid()
        self.list.schedule(uid, series, **more)
        return uid

    def reaches(self, uid, state):
        peers.until(lambda: self.list.state(uid) == state)

    def orders(self, daemon):
        return daemon.call("GET", "/v1/orders")[2]["orders"]

    def assert_performed(self, daemon, uid, series):
        """The workitem was claimed once, and names the objects that the PACS has."""
        self.assertEqual(self.list.claims[uid], 1)
        order, = [each for each in self.orders(daemon) if each["source"]["series"] == series.uid]
        order = self.succeeded(daemon, order["id"])
        performed = worklist.value(self.list.items[uid], worklist.PERFORMED)
        named = [worklist.value(worklist.value(each, "00081199"), "00081155")
                 for each in performed[worklist.OUTPUTS]["Value"]]
        self.assertEqual(named, [each["sop_instance_uid"] for each in order["results"]])
        self.assertEqual(self.stored(series), named[:1])
        self.assertEqual(len(self.pacs.objects(series.study, "SR")), 1)
        return order

    def test_a_workitem_is_performed(self):
        series = self.series()
        others = {"procedure": "READ^99HOSP^Read"}, {"00404041": {"vr": "CS",
                                                                  "Value": ["INCOMPLETE"]}}
        left = [self.scheduled(series, **each) for each in others]
        left.append(self.scheduled(series, **{worklist.INPUT: worklist.sequence()}))
        uid = self.scheduled(series)
        daemon = self.performer()
        self.reaches(uid, "COMPLETED")
        self.assert_performed(daemon, uid, series)
        self.assertEqual(self.list.refused, [])
        told = self.list.progress[uid]
        self.assertEqual([each for each in told if each],
                         ["waiting", "fetching", "meshing", "sending"])
        self.assertEqual([self.list.state(each) for each in left], ["SCHEDULED"] * 3)
        self.assertNotIn(self.list.secrets[uid], daemon.logged())
        self.assertNotIn(self.list.secrets[uid], str(self.orders(daemon)))

    def test_lost_messages_and_kills(self):
        """Connections break before or after the worklist has acted, and isomeshd is killed."""
        chance = random.Random(7)
        series = [self.series() for _ in range(2)]
        uids = [self.scheduled(each) for each in series]

        def fault(method, path):
            if method == "GET" and "?" in path:
                return None
            return chance.choice(["before", "after", None])
        self.list.fault = fault
        daemon = self.performer()
        for _ in range(3):
            peers.until(lambda: len(self.orders(daemon)) == 2)
            time.sleep(chance.uniform(0, 1))
            daemon.kill()
            daemon.start()
        self.list.fault = lambda method, path: None
        for uid, each in zip(uids, series):
            self.reaches(uid, "COMPLETED")
            self.assert_performed(daemon, uid, each)

    def test_a_failure_ends_the_workitem(self):
        series = self.series(radius=0)  # an empty surface
        uid = self.scheduled(series)
        daemon = self.performer()
        self.reaches(uid, "CANCELED")
        order, = self.orders(daemon)
        self.assertEqual(daemon.ended(order["id"])["state"], "failed")
        reason = worklist.value(worklist.value(self.list.items[uid], worklist.PROGRESS), "00741238")
        self.assertTrue(reason)

    def test_cancelling(self):
        """The order of a cancelled workitem is cancelled; a cancelled order cancels its own."""
        held = self.series(), self.series()
        uids = [self.scheduled(each) for each in held]
        self.proxy.fault = lambda method, path, body: (503, {}, b"")
        daemon = self.performer()
        for uid in uids:
            self.reaches(uid, "IN PROGRESS")
        peers.until(lambda: len(self.orders(daemon)) == 2)
        by_series = {each["source"]["series"]: each["id"] for each in self.orders(daemon)}
        daemon.call("DELETE", "/v1/orders/" + by_series[held[0].uid])
        self.reaches(uids[0], "CANCELED")
        self.assertEqual(daemon.ended(by_series[held[0].uid])["state"], "cancelled")
        with self.list.lock:
            self.list.items[uids[1]][worklist.STATE]["Value"] = ["CANCELED"]
        self.proxy.fault = None
        order = daemon.ended(by_series[held[1].uid])
        self.assertEqual(order["state"], "cancelled")
        self.assertIn("worklist", order["error"]["detail"])
        self.assertEqual(self.stored(held[1]), [])

    def test_worklists_that_break_rules(self):
        """Another performer is faster; then the list is no JSON, or has no UIDs."""
        series = self.series()
        taken = self.scheduled(series)

        def fault(method, path):
            if method == "PUT":
                self.list.items[taken][worklist.STATE]["Value"] = ["IN PROGRESS"]
                self.list.secrets[taken] = "1.2.3"
        self.list.fault = fault
        daemon = self.performer()
        peers.until(lambda: self.orders(daemon))
        order = daemon.ended(self.orders(daemon)[0]["id"])
        self.assertEqual(order["state"], "failed")
        self.assertIn("another performer", order["error"]["detail"])
        self.assertEqual(self.list.state(taken), "IN PROGRESS")
        self.assertEqual(self.stored(series), [])
        answers = [(200, b"<html>"), (200, b"[{}]"), (200, b'[{"00741000": 7}]'), (500, b"")]
        given = []

        def lie(_, path):
            given.append(path)
            return answers[len(given) % len(answers)]
        self.list.fault = lie
        peers.until(lambda: len(given) > len(answers))
        self.list.fault = None
        uid = self.scheduled(series)
        self.reaches(uid, "COMPLETED")
