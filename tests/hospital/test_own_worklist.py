"""isomesh as a worklist (UPS-RS): what it accepts, who may do it, and isomesh as its performer."""
import contextlib
import json
import os
import random
import re
import sqlite3
import subprocess
import time

import peers
import worklist
from fixture import ISOMESHD, Loop
from worklist import RULE, STATE, TRANSACTION, code, sequence, value

PATH = "/v1/dicomweb"
WORKITEMS = PATH + "/workitems"


def workitem(series, patient="PAT-4711"):
    """A workitem as a scheduler sends it."""
    return {STATE: {"vr": "CS", "Value": ["SCHEDULED"]},
            "00100020": {"vr": "LO", "Value": [patient]},
            "0020000D": {"vr": "UI", "Value": [series.study]},
            "00404005": {"vr": "DT", "Value": ["20260102030405"]},
            "00404041": {"vr": "CS", "Value": ["READY"]},
            "00741200": {"vr": "CS", "Value": ["MEDIUM"]},
            "00741204": {"vr": "LO", "Value": ["Mesh"]},
            worklist.PROCEDURE: sequence(code("MESH^99HOSP^Mesh of bone")),
            worklist.INPUT: sequence({"0020000D": {"vr": "UI", "Value": [series.study]},
                                      "0020000E": {"vr": "UI", "Value": [series.uid]}})}


class OwnWorklist(Loop):
    def ask(self, daemon, method, path, body=None, token=None, kind="application/dicom+json"):
        """Returns status, the text of the header Warning, and the data sets."""
        headers = {"Content-Type": kind} if body is not None and kind else {}
        if token:
            headers["Authorization"] = "Bearer " + token
        text = None if body is None else json.dumps(body)
        if method != "GET" and text is None:
            headers["Content-Length"] = "0"
        status, answered, data = peers.call(daemon.port, method, WORKITEMS + path, text, headers)
        warning = answered.get("Warning", "")
        if warning:
            self.assertTrue(warning.startswith('299 isomesh "'), warning)
        return status, warning[13:-1], json.loads(data) if data else None

    def scheduled(self, daemon, series, **more):
        uid = self.uid()
        self.assertEqual(self.ask(daemon, "POST", "?" + uid, workitem(series), **more)[0], 201)
        return uid

    def item(self, daemon, uid):
        status, _, (item,) = self.ask(daemon, "GET", "/" + uid)
        self.assertEqual(status, 200)
        self.assert_data_set(item)
        return item

    def assert_data_set(self, item):
        """It has attributes only, and not the secret one."""
        self.assertEqual([tag for tag in item if not re.fullmatch("[0-9A-F]{8}", tag)], [])
        self.assertNotIn(TRANSACTION, item)

    def reaches(self, daemon, uid, state):
        peers.until(lambda: value(self.item(daemon, uid), STATE) == state)

    def claim(self, transaction, state="IN PROGRESS"):
        return {STATE: {"vr": "CS", "Value": [state]},
                TRANSACTION: {"vr": "UI", "Value": [transaction]}}

    def assert_performed(self, daemon, performer, uid, series):
        orders = performer.call("GET", "/v1/orders")[2]["orders"]
        order, = [each for each in orders if each["source"]["series"] == series.uid]
        order = self.succeeded(performer, order["id"])
        performed = value(self.item(daemon, uid), worklist.PERFORMED)
        named = [value(value(each, "00081199"), "00081155")
                 for each in performed[worklist.OUTPUTS]["Value"]]
        self.assertEqual(named, [each["sop_instance_uid"] for each in order["results"]])
        self.assertEqual(self.stored(series), named[:1])

    def test_another_isomesh_performs(self):
        series = self.series()
        listing = self.daemon(rules="[worklist]")
        uid = self.scheduled(listing, series)
        performer = self.daemon(rules=RULE.format(port=listing.port, path=PATH))
        self.reaches(listing, uid, "COMPLETED")
        self.assert_performed(listing, performer, uid, series)
        self.assertEqual(self.ask(listing, "GET", "?ProcedureStepState=SCHEDULED")[0], 204)
        found = self.ask(listing, "GET", "?StudyInstanceUID=" + series.study)[2]
        self.assertEqual([value(each, "00080018") for each in found], [uid])
        self.assert_data_set(found[0])
        read = [each for each in listing.audit() if each.get("what") == "workitem"]
        self.assertEqual({(each["event"], each["study"], each["patient_id"]) for each in read},
                         {("110112", series.study, "PAT-4711")})
        self.assertTrue([each for each in listing.audit() if each.get("what") == "workitems"])

    def test_it_performs_its_own(self):
        """One daemon is both, and is killed at any time; its port changes."""
        chance = random.Random(3)
        way = peers.Proxy(0)
        self.addCleanup(way.close)
        series = [self.series() for _ in range(3)]
        daemon = self.daemon(rules=RULE.format(port=way.port, path=PATH) + "[worklist]")
        way.target = daemon.port
        uids = [self.scheduled(daemon, each) for each in series]
        for _ in range(4):
            time.sleep(chance.uniform(0.2, 1.5))
            daemon.kill()
            daemon.start()
            way.target = daemon.port
        for uid, each in zip(uids, series):
            self.reaches(daemon, uid, "COMPLETED")
            self.assert_performed(daemon, daemon, uid, each)

    def test_a_workitem_of_another_patient(self):
        """Nothing is made of the images of one patient for a workitem of another one."""
        series = self.series()
        listing = self.daemon(rules="[worklist]")
        uid = self.uid()
        self.assertEqual(self.ask(listing, "POST", "?" + uid, workitem(series, "PAT-4712"))[0], 201)
        performer = self.daemon(rules=RULE.format(port=listing.port, path=PATH))
        self.reaches(listing, uid, "CANCELED")
        order, = performer.call("GET", "/v1/orders")[2]["orders"]
        self.assertIn("another Patient ID", performer.ended(order["id"])["error"]["detail"])
        self.assertEqual(self.stored(series), [])

    def test_a_request_cancels_its_own(self):
        """A performer of the same daemon hears of a request; a second one changes nothing."""
        way = peers.Proxy(0)
        self.addCleanup(way.close)
        held = self.series()
        self.proxy.fault = lambda _, path, __: (503, {}, b"") if held.uid in path else None
        daemon = self.daemon(rules=RULE.format(port=way.port, path=PATH) + "[worklist]")
        way.target = daemon.port
        uid = self.scheduled(daemon, held)
        self.reaches(daemon, uid, "IN PROGRESS")
        for _ in range(2):
            self.assertEqual(self.ask(daemon, "POST", f"/{uid}/cancelrequest")[0], 202)
        self.reaches(daemon, uid, "CANCELED")
        order, = daemon.call("GET", "/v1/orders")[2]["orders"]
        self.assertEqual(daemon.ended(order["id"])["state"], "cancelled")
        status, warning, _ = self.ask(daemon, "POST", f"/{uid}/cancelrequest")
        self.assertEqual((status, warning), (202, "The UPS is already in the requested state of "
                                                  "CANCELED."))

    def test_a_failure_and_a_cancellation(self):
        """A workitem that nobody performs is cancelled here; one that isomesh performs, by its order."""
        listing = self.daemon(rules="[worklist]")
        refused = self.scheduled(listing, self.series())
        reason = {"00741238": {"vr": "LT", "Value": ["Wrong patient"]}}
        self.assertEqual(self.ask(listing, "POST", f"/{refused}/cancelrequest", reason)[0], 202)
        progress = value(self.item(listing, refused), worklist.PROGRESS)
        self.assertEqual(value(progress, "00741238"), "Wrong patient")
        empty = self.scheduled(listing, self.series(radius=0))
        held = self.series()
        uid = self.scheduled(listing, held)
        self.proxy.fault = lambda _, path, __: (503, {}, b"") if held.uid in path else None
        performer = self.daemon(rules=RULE.format(port=listing.port, path=PATH))
        self.reaches(listing, empty, "CANCELED")
        self.reaches(listing, uid, "IN PROGRESS")
        status, warning, _ = self.ask(listing, "POST", f"/{uid}/cancelrequest")
        self.assertEqual((status, warning), (409, "The performer cannot be contacted."))
        orders = performer.call("GET", "/v1/orders")[2]["orders"]
        order, = [each["id"] for each in orders if each["source"]["series"] == held.uid]
        performer.call("DELETE", "/v1/orders/" + order)
        self.reaches(listing, uid, "CANCELED")
        self.assertEqual(performer.ended(order)["state"], "cancelled")

    def test_what_it_says(self):
        """Statuses and warnings of PS3.18, 11, after a kill as before."""
        series = self.series()
        daemon = self.daemon(rules="[worklist]\nmax-workitems = 2")
        uid = self.scheduled(daemon, series)
        self.assertEqual(self.ask(daemon, "POST", "?" + uid, workitem(series))[0], 409)
        unready = {**workitem(series), STATE: {"vr": "CS", "Value": ["IN PROGRESS"]}}
        self.assertEqual(self.ask(daemon, "POST", "?" + self.uid(), unready)[0], 400)
        self.assertEqual(self.ask(daemon, "POST", "", workitem(series))[0], 400)
        for kind in ("application/dicom+xml", None):
            self.assertEqual(self.ask(daemon, "POST", "?" + self.uid(), workitem(series), kind=kind)[0], 415)
        numbered = {**workitem(series), "00741204": {"vr": "LO", "Value": [7]}}
        self.assertEqual(self.ask(daemon, "POST", "?" + self.uid(), numbered)[0], 400)
        own = {**workitem(series), "00080018": {"vr": "UI", "Value": [self.uid()]}}
        self.assertEqual(self.ask(daemon, "POST", "", [own])[0], 201)
        self.assertEqual(self.ask(daemon, "POST", "?" + self.uid(), workitem(series))[0], 503)
        status, warning, found = self.ask(daemon, "GET", "?limit=1")
        self.assertEqual((status, len(found), value(found[0], "00080018")), (200, 1, uid))
        self.assertEqual(warning, "There are additional results that can be requested")
        self.assertEqual(len(self.ask(daemon, "GET", "?limit=1&offset=1")[2]), 1)
        self.assertEqual(self.ask(daemon, "GET", "?offset=2")[0], 204)
        status, warning, found = self.ask(daemon, "GET", "?limit=5&fuzzymatching=TRUE")
        self.assertEqual((status, len(found), warning),
                         (200, 2, "The fuzzymatching parameter is not supported. Only literal matching has been performed."))
        self.assertEqual(self.ask(daemon, "GET", "?TransactionUID=1.99")[0], 400)
        self.assertEqual(self.ask(daemon, "GET", "/1.2.3")[0], 404)
        self.assertEqual(self.ask(daemon, "PUT", "/1.2.3/state", self.claim("1.99"))[0], 404)
        self.assertEqual(self.ask(daemon, "POST", f"/{uid}/subscribers/HERE")[0], 404)
        self.assertEqual(self.ask(daemon, "PUT", f"/{uid}/state", self.claim("1.99"))[0], 200)
        daemon.kill()
        daemon.start()
        status, warning, _ = self.ask(daemon, "PUT", f"/{uid}/state", self.claim("1.98"))
        self.assertEqual((status, warning), (409, "The submitted request is inconsistent with the "
                                             "state of the UPS Instance."))
        status, warning, _ = self.ask(daemon, "PUT", f"/{uid}/state",
                                      self.claim("1.98", "CANCELED"))
        self.assertEqual((status, warning), (400, "The Transaction UID is incorrect."))
        label = {"00741204": {"vr": "LO", "Value": ["New"]}}
        self.assertEqual(self.ask(daemon, "POST", f"/{uid}?1.98", label)[0], 400)
        self.assertEqual(self.ask(daemon, "POST", f"/{uid}?1.99", label)[0], 200)
        self.assertEqual(value(self.item(daemon, uid), "00741204"), "New")
        self.assertEqual(
            self.ask(daemon, "PUT", f"/{uid}/state", self.claim("1.99", "CANCELED"))[0], 200)
        status, warning, _ = self.ask(daemon, "POST", f"/{uid}/cancelrequest")
        self.assertEqual((status, warning),
                         (202, "The UPS is already in the requested state of CANCELED."))
        self.assertNotIn("1.99", daemon.logged())
        # A workitem that nobody changes for --keep-days is removed.
        daemon.kill()
        with contextlib.closing(sqlite3.connect(os.path.join(daemon.data, "isomesh.sqlite"))) as all_:
            all_.execute("UPDATE workitems SET changed = changed - ? WHERE uid = ?",
                         (40 * 86_400_000_000, uid))
            all_.commit()
        daemon.start()
        peers.until(lambda: self.ask(daemon, "GET", "/" + uid)[0] == 404)
        self.assertEqual(len(self.ask(daemon, "GET", "")[2]), 1)

    def test_who_may_do_what(self):
        tokens = os.path.join(self.folder.name, "tokens-" + self.uid())
        known = {}
        for name, role in [("ris", "user"), ("mesher", "user"), ("other", "user"),
                           ("boss", "admin")]:
            made = subprocess.run([ISOMESHD, "token", "add", name, "--into", tokens, "--role", role],
                                  check=True, capture_output=True, text=True).stdout
            known[name] = made.split()[0]
        daemon = self.daemon(None, 0, 60, 500_000_000, "", '[worklist]\nrequesters = ["ris"]\n'
                             'performers = ["mesher"]', "--tokens", tokens)
        series = self.series()
        new = {name: self.ask(daemon, "POST", "?" + self.uid(), workitem(series), token)[0]
               for name, token in known.items()}
        self.assertEqual(new, {"ris": 201, "mesher": 403, "other": 403, "boss": 201})
        listed = {name: self.ask(daemon, "GET", "?limit=1", token=token)[0]
                  for name, token in known.items()}
        self.assertEqual(listed, {"ris": 200, "mesher": 200, "other": 403, "boss": 200})
        uid = self.scheduled(daemon, series, token=known["ris"])
        claims = [self.ask(daemon, "PUT", f"/{uid}/state", self.claim("1.99"), known[name])[0]
                  for name in ("ris", "other", "mesher")]
        self.assertEqual(claims, [403, 403, 200])
        self.assertEqual(self.ask(daemon, "GET", "/" + uid)[0], 401)
        denied = [each for each in daemon.audit()
                  if each.get("caller") == "other" and each.get("what") == "workitems"]
        self.assertEqual([(each["event"], each["outcome"]) for each in denied],
                         [("110112", "failure")])
        self.assertIn("110113", [each["event"] for each in daemon.audit()])
