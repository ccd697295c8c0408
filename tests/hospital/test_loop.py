"""From the PACS and back, and everything that may go wrong on the way."""
import json
import os
import random
import threading
import time
import unittest

import dicom
import peers
from fixture import Loop


def is_wado(path):
    return "/series/" in path and "/instances" not in path and "?" not in path


class TheWay(Loop):
    def test_again_is_no_duplicate(self):
        series = self.series()
        daemon = self.daemon()
        first = self.succeeded(daemon, self.order(daemon, series))
        again = self.succeeded(daemon, self.order(daemon, series))
        self.assertNotEqual(first["id"], again["id"])
        self.assertEqual(first["results"], again["results"])
        self.assert_one_mesh(first, series)
        posts = [path for method, path in self.proxy.requests if method == "POST"]
        self.assertEqual(len(posts), 1)

    def test_the_same_key_is_the_same_order(self):
        series = self.series()
        daemon = self.daemon()
        first = self.order(daemon, series, {"Idempotency-Key": "k"})
        self.assertEqual(self.order(daemon, series, {"Idempotency-Key": "k"}), first)
        status, _, problem = daemon.call(
            "POST", "/v1/orders", {"source": {"pacs": "main", "study": "1.2", "series": "1.3"},
                                   "rule": "bone"}, {"Idempotency-Key": "k"})
        self.assertEqual((status, problem["type"]), (422, "urn:isomesh:problem:key-reused"))

    def test_two_daemons_name_an_object_alike(self):
        series = self.series()
        one, other = self.daemon(), self.daemon()
        first = self.succeeded(one, self.order(one, series))
        again = self.succeeded(other, self.order(other, series))
        self.assertEqual(first["results"], again["results"])
        self.assert_one_mesh(first, series)

    def test_other_parameters_are_another_series(self):
        series = self.series()
        daemon = self.daemon()
        first = self.succeeded(daemon, self.order(daemon, series))
        other = self.succeeded(daemon, self.order(daemon, series, parameters={"iso": 300}))
        self.assertNotEqual(first["results"][0]["series_uid"], other["results"][0]["series_uid"])
        self.assertEqual(len(self.stored(series)), 2)

    def test_several_series_in_a_study(self):
        one = self.series()
        other = dicom.Series(self.uid(), study=one.study, slices=9)
        self.pacs.upload(other.files.values())
        daemon = self.daemon()
        order = self.succeeded(daemon, self.order(daemon, other))
        self.assertEqual(order["source"]["instances"], 9)
        self.assertEqual(daemon.call("GET", "/v1/volumes/" + order["volume"])[2]["dims"][2], 9)

    def test_same_samples_other_patient(self):
        mine = self.series(patient_id="A-1", name="First^One")
        yours = self.series(patient_id="B-2", name="Second^One")
        daemon = self.daemon()
        one = self.succeeded(daemon, self.order(daemon, mine))
        other = self.succeeded(daemon, self.order(daemon, yours))
        self.assertNotEqual(one["volume"], other["volume"])
        found = self.pacs.objects(yours.study)
        self.assertEqual(len(found), 1)
        self.assertEqual(found[0]["00100020"]["Value"], ["B-2"])
        self.assertEqual(found[0]["00100010"]["Value"][0]["Alphabetic"], "Second^One")

    def test_nobody_is_told(self):
        """Neither the log nor the metrics nor the meshes hold anything of a patient."""
        series = self.series(patient_id="SECRET-ID-99", name="Geheim^Name")
        daemon = self.daemon()
        order = self.succeeded(daemon, self.order(daemon, series))
        self.proxy.fault = lambda *_: (400, {}, b"SECRET-ID-99 " + series.uid.encode())
        failed = daemon.ended(self.order(daemon, series))
        self.assertEqual(failed["state"], "failed")
        text = daemon.logged()
        text += peers.call(daemon.port, "GET", "/metrics")[2].decode()
        text += peers.call(daemon.port, "GET",
                           f"/v1/jobs/{order['job']}/mesh.stl")[2].decode("latin-1")
        text += str(failed["error"])
        for secret in ["SECRET-ID-99", "Geheim", series.uid, series.study, "ACC-1", "19700101",
                       order["results"][0]["sop_instance_uid"], *series.instances]:
            self.assertNotIn(secret, text)
        self.assertIn('isomesh_orders{rule="bone",state="succeeded"} 1', text)
        self.assertIn('isomesh_order_attempts_failed_total{pacs="main",reason="refused"} 1', text)

    def test_audit_events(self):
        series = self.series()
        daemon = self.daemon()
        self.succeeded(daemon, self.order(daemon, series))
        self.assertEqual(daemon.stop(), 0)
        told = [(each["event"], each.get("direction"), each.get("patient_id"), each["outcome"])
                for each in daemon.audit()]
        self.assertEqual(told, [("110120", None, None, "success"), ("110112", None, None, "success"),
                                ("110104", "in", "PAT-4711", "success"),
                                ("110104", "out", "PAT-4711", "success"),
                                ("110121", None, None, "success")])


class Faults(Loop):
    def test_pacs_down_then_up(self):
        series = self.series()
        self.pacs.kill()
        daemon = self.daemon()
        identity = self.order(daemon, series)
        waiting = peers.until(lambda: (lambda o: o if o["attempts"] >= 2 else None)(
            daemon.get(identity)))
        self.assertEqual(waiting["state"], "waiting")
        self.assertEqual(waiting["error"]["type"], "urn:isomesh:problem:pacs-unreachable")
        self.assertIsNotNone(waiting["next_attempt"])
        pacs = daemon.call("GET", "/v1/pacs")[2]["pacs"][0]
        self.assertEqual((pacs["name"], pacs["reason"]), ("main", "unreachable"))
        self.pacs.start()
        order = self.succeeded(daemon, identity)
        self.assertIsNone(order["error"])
        self.assert_one_mesh(order, series)

    def test_pacs_hangs(self):
        """One that hangs is given up after its timeout, and asked again."""
        series = self.series()
        over = threading.Event()
        self.proxy.fault = lambda *_: (lambda connection: over.wait(20) and False)
        daemon = self.daemon(timeout=1)
        identity = self.order(daemon, series)
        peers.until(lambda: daemon.get(identity)["attempts"] >= 1)
        self.assertEqual(daemon.call("GET", "/v1/pacs")[2]["pacs"][0]["reason"], "timeout")
        self.proxy.fault = None
        # An archive on a busy machine may itself be still for a second, now and then.
        self.assert_one_mesh(self.succeeded(daemon, identity, 180), series)
        over.set()

    def test_slow_peer(self):
        """Slow is not bad: longer than the timeout in all, but never still for so long."""
        series = self.series()
        begun = []

        def slowly(method, path, answer):
            if not is_wado(path):
                return None
            status, headers, text = answer
            begun.append(path)

            def drip(connection):
                head = f"HTTP/1.1 {status} OK\r\nContent-Length: {len(text)}\r\n"
                head += f"Content-Type: {headers['Content-Type']}\r\n\r\n"
                connection.sendall(head.encode())
                step = len(text) // 8 + 1
                for begin in range(0, len(text), step):
                    time.sleep(0.7)
                    connection.sendall(text[begin:begin + step])
                return False
            return drip
        self.proxy.twist = slowly
        daemon = self.daemon(timeout=5)
        self.succeeded(daemon, self.order(daemon, series))
        self.assertEqual(len(begun), 1)  # it was not given up

    def once(self, twist):
        """The next answer to a request for the series is what `twist` makes of it."""
        done = threading.Event()

        def only_once(method, path, answer):
            if not is_wado(path) or method != "GET" or done.is_set():
                return None
            done.set()
            return twist(answer)
        self.proxy.twist = only_once
        return done

    def after_one_incomplete(self, twist):
        series = self.series()
        done = self.once(twist)
        daemon = self.daemon()
        order = self.succeeded(daemon, self.order(daemon, series))
        self.assertTrue(done.is_set())
        self.assertEqual(order["attempts"], 1)
        self.assertEqual(order["source"]["instances"], 12)
        self.assert_one_mesh(order, series)
        self.assertEqual(daemon.call("GET", "/v1/volumes/" + order["volume"])[2]["dims"][2], 12)

    def test_transfer_broken_off(self):
        def cut(answer):
            status, headers, text = answer

            def half(connection):
                head = f"HTTP/1.1 {status} OK\r\nContent-Type: {headers['Content-Type']}\r\n\r\n"
                connection.sendall(head.encode() + text[:len(text) // 2])
                return False
            return half
        self.after_one_incomplete(cut)

    @staticmethod
    def parts_of(answer):
        status, headers, text = answer
        boundary = b"--" + headers["Content-Type"].split("boundary=")[1].split(";")[0].strip(
            '"').encode()
        return boundary, text.split(boundary)

    def test_foreign_series(self):
        other = self.series()

        def exchanged(answer):
            boundary, parts = self.parts_of(answer)
            body = list(other.files.values())[0]
            parts[1] = b"\r\nContent-Type: application/dicom\r\n\r\n" + body + b"\r\n"
            return answer[0], answer[1], boundary.join(parts)
        self.after_one_incomplete(exchanged)

    def test_instances_twice(self):
        series = self.series()

        def doubled(answer):
            boundary, parts = self.parts_of(answer)
            return answer[0], answer[1], boundary.join(parts[:3] + parts[1:])
        done = self.once(doubled)
        daemon = self.daemon()
        order = self.succeeded(daemon, self.order(daemon, series))
        self.assertTrue(done.is_set())
        self.assertEqual((order["attempts"], order["source"]["instances"]), (0, 12))

    def test_series_still_growing(self):
        series = dicom.Series(self.uid(), slices=12)
        files = list(series.files.values())
        self.pacs.upload(files[:5])
        daemon = self.daemon(settle=15)  # fifty times what passes between two of them
        identity = self.order(daemon, series)
        for data in files[5:]:
            time.sleep(0.3)
            self.pacs.upload([data])
        order = self.succeeded(daemon, identity)
        self.assertEqual(order["source"]["instances"], 12)
        self.assert_one_mesh(order, series)

    def test_refused(self):
        series = self.series()
        self.proxy.fault = lambda *_: (400, {}, b"no")
        daemon = self.daemon()
        identity = self.order(daemon, series)
        order = daemon.ended(identity)
        self.assertEqual((order["state"], order["error"]["type"]),
                         ("failed", "urn:isomesh:problem:pacs-refused"))
        self.proxy.fault = None
        status, _, again = daemon.call("POST", f"/v1/orders/{identity}/retry", {})
        self.assertEqual((status, again["state"]), (202, "waiting"))
        self.assert_one_mesh(self.succeeded(daemon, identity), series)
        self.assertEqual(daemon.call("POST", f"/v1/orders/{identity}/retry", {})[0], 409)

    def test_unknown_series(self):
        series = dicom.Series(self.uid())
        daemon = self.daemon()
        order = daemon.ended(self.order(daemon, series), 60)
        self.assertEqual(order["state"], "failed")
        self.assertIn("does not know the series", order["error"]["detail"])

    def test_unauthorized_is_tried_again_and_audited(self):
        series = self.series()
        self.proxy.fault = lambda *_: (401, {}, b"")
        daemon = self.daemon()
        identity = self.order(daemon, series)
        peers.until(lambda: daemon.get(identity)["attempts"] >= 1)
        self.assertEqual(daemon.call("GET", "/v1/pacs")[2]["pacs"][0]["reason"], "unauthorized")
        self.proxy.fault = None
        self.succeeded(daemon, identity)
        self.assertIn("110114", [each["event"] for each in daemon.audit()])

    def test_stow_that_lies_or_loses(self):
        """200 that names nothing, and 200 that names ours and keeps nothing, are not stored."""
        series = self.series()
        count = []

        def lies(method, path, body):
            if method != "POST" or len(count) >= 2:
                return None
            count.append(path)
            instance = self.mesh_in(body)
            said = "{}" if len(count) == 1 else (
                '{"00081199": {"vr": "SQ", "Value": [{"00081155": {"vr": "UI", "Value": ["'
                + instance + '"]}}]}}')
            return 200, {"Content-Type": "application/dicom+json"}, said.encode()
        self.proxy.fault = lies
        daemon = self.daemon()
        order = self.succeeded(daemon, self.order(daemon, series))
        self.assertEqual((len(count), order["attempts"]), (2, 2))
        self.assert_one_mesh(order, series)

    @staticmethod
    def mesh_in(body):
        at = body.index(b"\x08\x00\x18\x00UI") + 8
        return body[at:at + 64].split(b"\0")[0].split(b"\x08")[0].decode()

    def test_stow_failure_reasons(self):
        """A7xx may pass, anything else does not."""
        def failing(reason):
            def fault(method, path, body):
                if method != "POST":
                    return None
                said = ('{"00081198": {"vr": "SQ", "Value": [{"00081155": {"vr": "UI", "Value": ["'
                        + self.mesh_in(body) + '"]}, "00081197": {"vr": "US", "Value": ['
                        + str(reason) + ']}}]}}')
                return 409, {"Content-Type": "application/dicom+json"}, said.encode()
            return fault
        daemon = self.daemon()
        self.proxy.fault = failing(0xA900)
        order = daemon.ended(self.order(daemon, self.series()))
        self.assertEqual((order["state"], order["error"]["type"]),
                         ("failed", "urn:isomesh:problem:pacs-refused"))
        self.proxy.fault = failing(0xA700)
        identity = self.order(daemon, self.series())
        peers.until(lambda: daemon.get(identity)["attempts"] >= 1)
        self.proxy.fault = None
        self.succeeded(daemon, identity)

    def test_patient_merged_before_sending(self):
        """The study becomes another patient's between fetching and sending: it is fetched again."""
        series = self.series(patient_id="OLD-1")
        merged = []

        def merge(method, path, body):
            if "/studies?" in path and not merged:
                merged.append(path)
                for file in series.files:
                    _, _, found = self.pacs.call("POST", "/tools/lookup", file)
                    self.pacs.call("DELETE", json.loads(found)[0]["Path"])
                changed = dicom.Series(series.uid[:-2], patient_id="NEW-2")
                self.pacs.upload(changed.files.values())
            return None
        self.proxy.fault = merge
        daemon = self.daemon()
        order = self.succeeded(daemon, self.order(daemon, series))
        self.assertTrue(merged)
        found = self.pacs.objects(series.study)
        self.assertEqual([each["00100020"]["Value"] for each in found], [["NEW-2"]])
        self.assert_one_mesh(order, series)

    def test_empty_surface_and_too_big(self):
        series = self.series()
        daemon = self.daemon(most=1000)
        order = daemon.ended(self.order(daemon, series, parameters={"iso": 5000}))
        self.assertIn("empty", order["error"]["detail"])
        order = daemon.ended(self.order(daemon, series))
        self.assertEqual((order["state"], order["error"]["type"]),
                         ("failed", "urn:isomesh:problem:too-large"))
        self.assertIn("max-send-bytes", order["error"]["detail"])

    def test_gap_fails_with_its_detail(self):
        series = dicom.Series(self.uid())
        files = list(series.files.values())
        self.pacs.upload(files[:5] + files[6:])
        daemon = self.daemon()
        order = daemon.ended(self.order(daemon, series))
        self.assertEqual((order["state"], order["error"]["status"]), ("failed", 422))
        self.assertIn("missing", order["error"]["detail"])

    def test_killed_at_any_time(self):
        """kill -9 of daemon and PACS at any time: one object each, and none twice."""
        count, kills = (int(n) for n in os.environ.get("ISOMESH_KILLS", "10,8").split(","))
        all_series = [self.series() for _ in range(count)]
        daemon = self.daemon(port=self.pacs.port)
        orders = [self.order(daemon, series) for series in all_series]
        dice = random.Random(17)
        for _ in range(kills):
            time.sleep(dice.uniform(0.05, 0.6))
            if dice.random() < 0.7:
                daemon.kill()
                daemon.start()
            else:
                self.pacs.kill()
                time.sleep(0.2)
                self.pacs.start()
        for identity, series in zip(orders, all_series):
            order = self.succeeded(daemon, identity, 180)
            self.assert_one_mesh(order, series)


if __name__ == "__main__":
    unittest.main()
