"""The button in Orthanc Explorer, client/orthanc, by the routes that its page asks."""
import json
import os
import runpy
import shutil
import subprocess
import sys
import types
import unittest
from unittest import mock

import dicom
import peers
from fixture import ISOMESHD, HOSPITAL, ROOT

SCRIPT = os.path.realpath(os.path.join(os.path.dirname(__file__), "../../client/orthanc/isomesh_orthanc.py"))
WEB = os.path.realpath(os.path.join(os.path.dirname(__file__), "../../client/web/node_modules/playwright-core"))
PLUGIN = "/usr/share/orthanc/plugins/libOrthancPython.so"
JSON = {"Content-Type": "application/json"}


@unittest.skipUnless(os.path.exists(PLUGIN), "orthanc-python is not installed")
class Page(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = peers.temporary_folder()
        cls.addClassCleanup(cls.folder.cleanup)
        tokens = os.path.join(cls.folder.name, "tokens")
        cls.token = subprocess.run([ISOMESHD, "token", "add", "orthanc", "--role", "user", "--into", tokens], check=True,
                                   capture_output=True, text=True).stdout.strip()
        pacs_port = peers.free_port()
        hospital = HOSPITAL.format(port=pacs_port, settle=0, timeout=60, most=500_000_000, pacs="",
                                   rules='owner = "orthanc"')
        cls.daemon = peers.Daemon(ISOMESHD, os.path.join(cls.folder.name, "daemon"), hospital, "--tokens", tokens)
        cls.addClassCleanup(lambda: cls.daemon.process.poll() is None and cls.daemon.kill())
        cls.proxy = peers.Proxy(cls.daemon.port)
        cls.addClassCleanup(cls.proxy.close)
        url = f"http://127.0.0.1:{cls.proxy.port}"
        with open(os.path.join(os.path.dirname(SCRIPT), "python.json"), encoding="utf-8") as file:
            more = {**json.load(file), "PythonScript": SCRIPT}
        more["Isomesh"].update({"Url": url, "Page": "https://isomesh.example.org/", "Token": cls.token, "Rules": ["bone", "none"]})
        cls.pacs = peers.Orthanc(os.path.join(cls.folder.name, "pacs"), port=pacs_port, plugins=[PLUGIN], more=more)
        cls.addClassCleanup(cls.pacs.kill)
        cls.series = dicom.Series(ROOT + ".73")
        cls.pacs.upload(cls.series.files.values())
        cls.identity = cls.lookup(cls.series.uid)

    @classmethod
    def lookup(cls, uid):
        return json.loads(cls.pacs.call("POST", "/tools/lookup", uid)[2])[0]["ID"]

    def order(self, series, body, headers=JSON):
        status, _, text = peers.call(self.pacs.port, "POST", "/isomesh/series/" + series, body, headers)
        return status, json.loads(text)

    def test_the_mesh_of_a_series_is_in_its_study(self):
        status, order = self.order(self.identity, json.dumps({"rule": "bone"}))
        self.assertEqual(status, 200, order)

        def ended():
            status, _, text = self.pacs.call("GET", "/isomesh/orders/" + order["id"])
            self.assertEqual(status, 200, text)
            now = json.loads(text)
            return now if now["state"] in ("succeeded", "failed", "cancelled") else None
        end = peers.until(ended)
        self.assertEqual((end["state"], end["error"], end["results"]), ("succeeded", None, 1))
        self.assertEqual(len(self.pacs.objects(self.series.study)), 1)
        job = self.daemon.call("GET", "/v1/orders/" + order["id"], headers={"Authorization": "Bearer " + self.token})[2]["job"]
        self.assertEqual(end["link"], f"https://isomesh.example.org/#/jobs/{job}")

    def test_the_reason_of_isomesh_is_shown(self):
        status, answer = self.order(self.identity, json.dumps({"rule": "none"}))
        self.assertEqual(status, 400)
        said = self.daemon.call("POST", "/v1/orders", {"rule": "none", "source": {
            "pacs": "main", "study": self.series.study, "series": self.series.uid}}, {"Authorization": "Bearer " + self.token})
        self.assertEqual(answer, {"error": said[2]["detail"]})
        self.assertEqual(self.pacs.call("GET", "/isomesh/orders/unknown")[0], 404)

    def test_wrong_requests_reach_nobody(self):
        bone = json.dumps({"rule": "bone"})
        before = len(self.proxy.requests)
        for series, body, headers, status in (
            (self.identity, bone, {"Content-Type": "text/plain"}, 415),
            (self.identity, "{", JSON, 400),
            (self.identity, "[]", JSON, 400),
            (self.identity, '{"rule": "other"}', JSON, 400),
            (self.identity, '{"rule": ["bone"]}', JSON, 400),
            ("0" * 44, bone, JSON, 404),
        ):
            with self.subTest(series=series, body=body, headers=headers):
                seen, answer = self.order(series, body, headers)
                self.assertEqual(seen, status)
                self.assertIn("error", answer)
        self.assertEqual(self.pacs.call("GET", "/isomesh/series/" + self.identity)[0], 405)
        for path in ("/isomesh/orders/..%2Fjobs", "/isomesh/orders/a%20b", "/isomesh/series/abc"):
            self.assertEqual(self.pacs.call("GET", path)[0], 404, path)
        self.assertEqual(len(self.proxy.requests), before)

    def test_a_failure_of_isomesh_is_said(self):
        refused = json.dumps({"detail": "The token is not known"}).encode()
        for fault, status, detail in (
            (lambda *_: (lambda connection: False), 502, "isomesh gave no answer: Remote end closed connection without response"),
            (lambda *_: (504, {"Content-Type": "text/html"}, b"<html>"), 504, "isomesh answered with status 504"),
            (lambda *_: (307, {"Location": "http://127.0.0.1:9/"}, b""), 502, "isomesh answered with status 307"),
            (lambda *_: (lambda connection: connection.sendall(b"no HTTP\r\n\r\n")), 502, "isomesh gave no answer: no HTTP"),
            (lambda *_: (200, {"Content-Type": "text/html"}, b"<html>"), 502, "isomesh gave no answer: Expecting value"),
            (lambda *_: (401, {"Content-Type": "application/json"}, refused), 502, "The token is not known"),
        ):
            self.proxy.fault = fault
            try:
                seen, answer = self.order(self.identity, json.dumps({"rule": "bone"}))
            finally:
                self.proxy.fault = None
            self.assertEqual(seen, status, answer)
            self.assertTrue(answer["error"].startswith(detail), answer)

    def test_ids_are_uids(self):
        series = dicom.Series(ROOT + ".74/../x")
        self.pacs.upload(series.files.values())
        before = len(self.proxy.requests)
        status, answer = self.order(self.lookup(series.uid), json.dumps({"rule": "bone"}))
        self.assertEqual((status, len(self.proxy.requests)), (400, before))
        self.assertIn("StudyInstanceUID of the series is not a UID", answer["error"])

    def test_a_wrong_configuration_is_named(self):
        right = {"Url": "http://127.0.0.1", "Pacs": "main", "Rules": ["bone"]}
        for section, reason in (
            (None, "has no section"), ({"Url": "x"}, 'needs the key "Pacs"'), ({**right, "Rule": "bone"}, 'unknown key "Rule"'),
            ({**right, "Token": 7}, '"Token" must be a text'), ({**right, "Page": "javascript:x"}, '"Page" must begin with'),
            ({**right, "Rules": "bone"}, '"Rules" must be a list'),
        ):
            orthanc = types.ModuleType("orthanc")
            orthanc.GetConfiguration = lambda section=section: json.dumps({} if section is None else {"Isomesh": section})
            with self.subTest(section=section), mock.patch.dict(sys.modules, orthanc=orthanc):
                with self.assertRaisesRegex(ValueError, reason):
                    runpy.run_path(SCRIPT)

    def test_the_page_gets_the_rules_and_no_secret(self):
        _, _, script = self.pacs.call("GET", "/plugins/explorer.js")
        self.assertIn(b'["bone", "none"]', script)
        self.assertNotIn(self.token.encode(), script)

    @unittest.skipUnless(os.path.exists(WEB), "the packages of client/web are not installed (npm ci)")
    @unittest.skipUnless(shutil.which("chromium") and shutil.which("node"), "chromium or node is not installed")
    def test_the_buttons_say_how_it_goes(self):
        picture = os.environ.get("ISOMESH_PICTURES")
        ran = subprocess.run(
            ["node", os.path.join(os.path.dirname(__file__), "orthanc_page.mjs"), f"http://127.0.0.1:{self.pacs.port}",
             self.identity, *([os.path.join(picture, "orthanc.png")] if picture else [])],
            env={**os.environ, "CHROMIUM": shutil.which("chromium")}, check=False, capture_output=True, text=True, timeout=120)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        page = json.loads(ran.stdout)
        self.assertEqual(page["texts"][0], "The mesh is in the study (1 object). Show it in isomesh")
        self.assertTrue(page["link"].startswith("https://isomesh.example.org/#/jobs/"), page)
        status, answer = self.order(self.identity, json.dumps({"rule": "none"}))
        self.assertEqual((page["texts"][1], status), (answer["error"], 400))
        self.assertEqual((page["buttons"], page["faults"]), (2, []))
        self.assertEqual(len(self.pacs.objects(self.series.study)), 1)
