"""Many volumes in one call."""

import contextlib
import io
import json
import sys
import threading
import unittest
import warnings
from pathlib import Path
from unittest import mock

import isomesh_client
import numpy
from limits import LimitedTest
from support import DaemonTest, FakeServer, ball


class Batches(DaemonTest):
    limit_s = 60

    @classmethod
    def prepare(cls, folder):
        cls.scans = [folder / "scans" / name for name in ("c.npy", "a.npy", "b.npy", "no volume.nii.gz")]
        cls.scans[0].parent.mkdir()
        for radius, path in enumerate(cls.scans[:3], start=4):
            numpy.save(path, ball(size=(20, 20, 20), radius=radius).transpose())
        cls.scans[3].write_bytes(b"no volume")

    def setUp(self):
        caught = warnings.catch_warnings()
        caught.__enter__()
        self.addCleanup(caught.__exit__, None, None, None)
        warnings.simplefilter("ignore", isomesh_client.VolumeWarning)  # .npy files have no patient

    def test_results_are_in_order_and_failures_are_values(self):
        seen = []
        results = self.client.mesh_all(iter(self.scans), spacing=(1, 1, 1), iso=-5, workers=3, progress=seen.append)
        self.assertEqual([each.source for each in results], self.scans)
        self.assertEqual(sorted(map(id, seen)), sorted(map(id, results)))
        self.assertEqual([bool(each) for each in results], [True, True, True, False])
        self.assertIsInstance(results[3].error, isomesh_client.Refused)
        self.assertRegex(repr(results[3]), r"^<Result of no volume\.nii\.gz: Refused: .*>$")
        self.assertRegex(repr(results[0]), r"^<Result of c\.npy: <Mesh of \d+ triangles .*>>$")
        self.assertEqual(results[0].job["mesh"]["triangles"], len(results[0].mesh.faces))
        alone = self.client.mesh(self.scans[1], spacing=(1, 1, 1), iso=-5)
        self.assertEqual(results[1].mesh.vertices.tolist(), alone.vertices.tolist())

    def test_the_same_call_resumes(self):
        to = self.folder / "new" / "meshes" / "{folder} {name}.stl"
        first = self.client.mesh_all(self.scans[:2], to=to, spacing=(1, 1, 1), iso=-5)
        self.assertEqual([each.error for each in first], [None, None])
        self.assertEqual([each.path.name for each in first], ["scans c.stl", "scans a.stl"])
        self.assertIsNone(first[0].mesh)
        self.assertEqual(first[0].path.stat().st_size, 84 + 50 * first[0].job["mesh"]["triangles"])
        times = [each.path.stat().st_mtime_ns for each in first]
        second = self.client.mesh_all(self.scans, to=to, skip_existing=True, spacing=(1, 1, 1), iso=-5)
        self.assertEqual([each.skipped for each in second], [True, True, False, False])
        self.assertEqual([each.path.stat().st_mtime_ns for each in second[:2]], times)
        self.assertEqual([each.path.exists() for each in second], [True, True, True, False])
        self.assertRegex(repr(second[0]), r"^<Result of c\.npy: .*scans c\.stl was there>$")

    def test_a_bar_is_tqdms_if_that_is_there(self):
        class Bar:
            def __new__(cls, each, total, unit):
                cls.seen = (total, unit)
                return each

        module = type(sys)("tqdm.auto")
        module.tqdm = Bar
        with mock.patch.dict(sys.modules, {"tqdm": type(sys)("tqdm"), "tqdm.auto": module}):
            self.client.mesh_all(self.scans[:1], spacing=(1, 1, 1), iso=-5, progress=True)
        self.assertEqual(Bar.seen, (1, "mesh"))
        with mock.patch.dict(sys.modules, {"tqdm.auto": None}), contextlib.redirect_stderr(io.StringIO()) as told:
            self.client.mesh_all(self.scans[:2], spacing=(1, 1, 1), iso=-5, progress=True)
        self.assertTrue(told.getvalue().endswith("\r2 of 2\n"), told.getvalue())

    def test_a_preset_has_a_name(self):
        scan = ball(size=(20, 20, 20)) * 100 + 900
        named = self.client.mesh(scan, modality="ct", iso="bone")
        self.assertEqual(named.job["parameters"]["iso"], 250)
        (result,) = self.client.mesh_all([scan], modality="ct", iso="bone", to=lambda _: self.folder / "bone.ply")
        self.assertEqual(isomesh_client.read_ply(result.path).faces.tolist(), named.faces.tolist())

    def test_labels_of_a_job_are_a_list(self):
        job = self.client.mesh((ball() > -9).astype("uint8"), labels="all").job
        self.assertEqual([each["label"] for each in self.client.job_labels(job)[:1]], [1])
        self.assertEqual(len(self.client.job_walls(job)), 1)


class Arguments(LimitedTest):
    def test_mistakes_are_found_before_anything_is_sent(self):
        client = isomesh_client.Client("http://127.0.0.1:1")
        self.assertEqual(repr(client), "<Client of http://127.0.0.1:1>")
        for arguments, keywords, kind, text in (
            ("a.nii", {"iso": 1}, TypeError, r"must be a list, for example \['a.nii'\]"),
            (["a.nii"], {"isso": 1}, TypeError, "mesh_all.. has no parameter 'isso'; did you mean 'iso'"),
            (["x/a.nii", "y/a.nii.gz"], {"to": "{name}.glb"}, ValueError, r"x/a.nii and y/a.nii.gz would have the same file, a.glb"),
            (["a.nii"], {"to": "{nam}.glb"}, ValueError, r"to= knows \{name\}, .* not \{nam\}"),
            (["a.nii"], {"to": "{name}.png"}, ValueError, "'a.png' is not a mesh format"),
            (["a.nii"], {"to": "{name}.glb", "formats": ["stl"]}, ValueError, "the suffix in to= selects the format"),
            (["a.nii"], {"skip_existing": True}, ValueError, "needs to="),
            (["a.nii"], {"workers": 0}, ValueError, "at least 1, not 0"),
            ([numpy.zeros((2, 2, 2))], {"to": "{name}.glb"}, ValueError, "ndarray has no name for to="),
        ):
            with self.subTest(text), self.assertRaisesRegex(kind, text):
                client.mesh_all(arguments, **keywords)
        self.assertEqual(client.mesh_all([], iso=1), [])

    def test_an_interrupt_ends_the_batch_and_its_jobs(self):
        """The second source fails at once, and its result interrupts while the job of the first runs."""
        cancelled = threading.Event()
        running = {"id": "1", "state": "running", "volume": "v", "error": None, "mesh": None, "stage": "smooth", "progress": 0}
        begun = threading.Event()

        def respond(handler, _):
            if handler.command == "DELETE" or handler.path.endswith("/cancel"):
                cancelled.set()
            elif handler.command == "GET":
                begun.set()
            state = "cancelled" if cancelled.is_set() else "running"
            return 200, {"Content-Type": "application/json"}, json.dumps({**running, "state": state}).encode()

        def interrupt(_):
            begun.wait(30)
            raise KeyboardInterrupt

        with FakeServer(respond) as server:
            volume = {"id": "a" * 64, "notes": [], "range": [0, 1]}
            with self.assertRaises(KeyboardInterrupt):
                isomesh_client.Client(server.url).mesh_all([volume, Path("not there")], iso=1, progress=interrupt)
        self.assertTrue(cancelled.is_set())


if __name__ == "__main__":
    unittest.main()
