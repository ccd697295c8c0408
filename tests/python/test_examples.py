"""The example for curl and the shown lines against a server that fails. tests/install/run tries the example with a daemon."""

import os
import re
import subprocess
import tempfile
import unittest
from pathlib import Path
from unittest import mock

from limits import LimitedTest
from support import ROOT, FakeServer

MESH = b"the new mesh"
ANSWERS = {"/v1/volumes": b'{"id":"v"}', "/v1/jobs": b'{"id":"j"}', "/v1/jobs/j": b'{"state":"succeeded"}'}
BROKEN = b'{"status":503,"detail":"The disk \x1b[2Jis \x7faway."}'


class Curl(LimitedTest):
    def setUp(self):
        work = tempfile.TemporaryDirectory()
        self.addCleanup(work.cleanup)
        self.folder = Path(work.name)
        (self.folder / "head.nrrd").write_bytes(b"NRRD0004\n")
        self.mesh = self.folder / "head.stl"
        self.mesh.write_bytes(b"an earlier mesh")

    def run_against(self, failing="", headers=None, body=BROKEN):
        def respond(handler, _):
            path = handler.path.partition("?")[0]
            if path == failing:
                return 503, headers or {}, body
            return 200, {}, ANSWERS.get(path, MESH)

        with FakeServer(respond) as server:
            return subprocess.run(
                [ROOT / "examples/curl/mesh.sh", self.folder / "head.nrrd", "60", self.mesh],
                env={**os.environ, "ISOMESH_SERVER": server.url},
                check=False,
                capture_output=True,
                text=True,
                timeout=60,
            )

    def assert_kept(self, ran):
        self.assertEqual(ran.returncode, 1, ran.stderr)
        self.assertEqual(self.mesh.read_bytes(), b"an earlier mesh")
        self.assertEqual(sorted(os.listdir(self.folder)), ["head.nrrd", "head.stl"])

    def test_the_mesh_takes_the_place_of_an_earlier_one(self):
        ran = self.run_against()
        self.assertEqual((ran.returncode, ran.stdout), (0, f"{self.mesh}\n"), ran.stderr)
        self.assertEqual(self.mesh.read_bytes(), MESH)
        self.assertEqual(sorted(os.listdir(self.folder)), ["head.nrrd", "head.stl"])

    def test_an_error_of_any_step_keeps_the_earlier_mesh(self):
        for path in (*ANSWERS, "/v1/jobs/j/mesh.stl"):
            with self.subTest(path):
                ran = self.run_against(path)
                self.assert_kept(ran)
                self.assertRegex(ran.stderr, r"mesh\.sh: .*The disk \[2Jis away\.\n")
                self.assertTrue(ran.stderr.rstrip("\n").isprintable(), repr(ran.stderr))

    def test_an_error_that_is_no_json_is_told_by_its_status(self):
        ran = self.run_against("/v1/jobs/j/mesh.stl", body=b"<html>\x1b[2J</html>")
        self.assert_kept(ran)
        self.assertIn("status 503", ran.stderr)
        self.assertNotIn("\x1b", ran.stderr)

    def test_an_empty_surface_keeps_the_earlier_mesh(self):
        job = b'{"state":"succeeded","mesh":{"empty":true,"empty_reason":"the labels have none","triangles":0}}'
        with mock.patch.dict(ANSWERS, {"/v1/jobs/j": job}):
            ran = self.run_against()
        self.assert_kept(ran)
        self.assertIn("the surface is empty: the labels have none", ran.stderr)


class CurlLines(LimitedTest):
    """The lines of README and docs that save a mesh, or anything else, as they stand there."""

    def lines(self):
        for document in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
            text = document.read_text()
            for line in re.findall(r"(?m)^    (curl (?:.*\\\n)*.*)$", text):
                if re.search(r" (-o|-O|--output)\b", line):
                    yield document.name, line

    def run_line(self, line, respond):
        with tempfile.TemporaryDirectory() as work, FakeServer(respond) as server:
            folder = Path(work)
            (folder / "head.nii.gz").write_bytes(b"volume")
            ran = subprocess.run(
                ["bash", "-c", line.replace("http://127.0.0.1:8080", server.url)],
                cwd=folder, check=False, capture_output=True, text=True, timeout=60,
            )
            return ran, {each.name: each.read_bytes() for each in folder.iterdir() if each.name != "head.nii.gz"}

    def test_a_failure_leaves_no_file_and_a_status(self):
        seen = set()
        for document, line in self.lines():
            with self.subTest(line):
                ran, files = self.run_line(line, lambda *_: (200, {}, MESH))
                self.assertEqual(ran.returncode, 0, ran.stderr)
                (name,) = files
                self.assertEqual(files, {name: MESH})
                self.assertNotEqual(name, "response")
                ran, files = self.run_line(line, lambda *_: (422, {}, b'{"detail":"the surface is empty"}'))
                self.assertNotEqual(ran.returncode, 0)
                self.assertEqual(files, {})
                if "POST" in line:
                    self.assertIn("the surface is empty", ran.stdout)
                elsewhere = line.replace("http://127.0.0.1:8080", "http://127.0.0.1:1")
                ran, files = self.run_line(elsewhere, None)
                self.assertNotEqual(ran.returncode, 0)
                self.assertEqual(files, {})
                seen.add(document)
        self.assertLessEqual({"README.md", "http.md", "for-web-developers.md"}, seen)


if __name__ == "__main__":
    unittest.main()
