"""Many volumes in one call."""

import contextlib
import io
import json
import os
import signal
import socket
import sys
import tempfile
import threading
import time
import unittest
import warnings
from pathlib import Path
from unittest import mock

import isomesh_client
import numpy
from limits import LimitedTest
from support import ROOT, DaemonTest, FakeServer, ball


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

    def test_no_mesh_replaces_a_source_or_another_mesh(self):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "set").mkdir()
            for file in ("x.vtk", "y.vtk", "a b.nii", "a_b.nii", "c.mtl", "set/z.vtk"):
                (folder / file).write_bytes(b"volume")
            (folder / "set" / "dangling").symlink_to("nowhere")  # the upload of this folder fails
            (folder / "link").symlink_to(folder, target_is_directory=True)
            for sources, to, keywords, text in (
                (["x.vtk"], "{file}", {}, "the mesh of .*x.vtk would replace .*x.vtk, which is a file of a source"),
                (["y.vtk", "x.vtk"], "link/{file}", {}, "y.vtk would replace .*link/y.vtk"),
                (["set", "x.vtk"], lambda _: folder / "set" / "z.vtk", {}, "would replace .*z.vtk"),
                (["a b.nii", "a_b.nii"], "{name}.obj", {"labels": "all"}, "a b.nii and .*a_b.nii would have the same file, .*a_b.mtl"),
                (["a b.nii", "a_b.nii"], "{name}.obj", {"masks": True}, "the same file, .*a_b.mtl"),
                (["c.mtl"], lambda _: folder / "c.obj", {"labels": [1]}, "would replace .*c.mtl"),
                (["x.vtk", "y.vtk"], lambda each: folder / ("link" if each.stem == "x" else "") / "one.stl", {}, "the same file, .*one.stl"),
            ):
                target = to if callable(to) else folder / to
                with self.subTest(text), self.assertRaisesRegex(ValueError, text):
                    isomesh_client.Client("http://127.0.0.1:1").mesh_all([folder / each for each in sources], to=target, **keywords)
            # A skipped source is not replaced: a mesh may lie in the folder of its slices.
            (folder / "whole").mkdir()
            (folder / "whole" / "slice.dcm").write_bytes(b"volume")
            (folder / "whole" / "mesh.stl").write_bytes(b"mesh")
            of_folder = {"to": lambda each: each / "mesh.stl", "iso": 1}
            (result,) = isomesh_client.Client("http://127.0.0.1:1").mesh_all([folder / "whole"], skip_existing=True, **of_folder)
            self.assertTrue(result.skipped)
            with self.assertRaisesRegex(ValueError, "would replace .*mesh.stl"):
                isomesh_client.Client("http://127.0.0.1:1").mesh_all([folder / "whole"], **of_folder)
            # Without labels there are no materials.
            results = isomesh_client.Client("http://127.0.0.1:1").mesh_all([folder / "a b.nii", folder / "a_b.nii"], to=folder / "{name}.obj", iso=1)
            self.assertEqual([type(each.error) for each in results], 2 * [isomesh_client.Unreachable])

    def test_a_source_that_no_file_can_be_is_one_failure(self):
        odd = ["x" * 300 + ".nii", "a\0b.nii", "a\0b/c.nii"]
        with tempfile.TemporaryDirectory() as folder:
            good = Path(folder, "good.nii")
            good.write_bytes(b"x")
            for to in ("{name}.stl", "{folder}/{name}.stl"):
                results = isomesh_client.Client("http://127.0.0.1:1").mesh_all(
                    [*odd, good], to=folder + "/" + to, skip_existing=True, iso=1
                )
                self.assertEqual([each.source for each in results], [*odd, good])
                self.assertIsInstance(results[3].error, isomesh_client.Unreachable)
                self.assertTrue(all(isinstance(each.error, (OSError, ValueError)) for each in results[:3]), results)

    def test_a_name_has_no_suffix_of_a_volume(self):
        names = {"x" + suffix: "x" for suffix in isomesh_client.api.VOLUME_SUFFIXES}
        self.assertGreater(len(names), 30)
        # The command has a test of the same.
        more = dict(line.split() for line in (ROOT / "tests/support/names_of_volumes.txt").read_text().splitlines())
        self.assertGreater(len(more), 9)
        for file, name in {**names, **more}.items():
            with tempfile.TemporaryDirectory() as folder:
                (result,) = isomesh_client.Client("http://127.0.0.1:1").mesh_all([file], to=Path(folder, "{name}.stl"), iso=1)
                self.assertEqual(result.path.name, name + ".stl")

    def test_the_name_of_a_volume_leads_to_no_other_folder(self):
        for name, file in (
            ("../../evil", ".._.._evil.stl"), ("/etc/evil", "_etc_evil.stl"), ("a\\b\n\x1b[31m", "a_b\ufffd\ufffd[31m.stl"),
            ("..", "__.stl"), ("CT of the head", "CT of the head.stl"),
        ):
            volume = {"id": "a" * 64, "name": name, "notes": []}
            with tempfile.TemporaryDirectory() as folder:
                (result,) = isomesh_client.Client("http://127.0.0.1:1").mesh_all([volume], to=Path(folder, "{name}.stl"), iso=1)
                self.assertEqual(result.path, Path(folder, file))

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


class Interrupts(LimitedTest):
    """Ctrl-C while all threads of a batch wait for the server."""

    limit_s = 60

    def setUp(self):
        self.waits = threading.Event()  # a request has come
        self.over = threading.Event()
        self.addCleanup(self.over.set)
        self.seen = []

    def interrupted(self, url, source):
        """Interrupts a batch as soon as `waits` is set, and returns the seconds until it has ended."""

        def interrupt():
            self.waits.wait(30)
            self.began = time.monotonic()
            os.kill(os.getpid(), signal.SIGINT)

        interrupter = threading.Thread(target=interrupt)
        interrupter.start()
        with self.assertRaises(KeyboardInterrupt):
            isomesh_client.Client(url).mesh_all([source, source, source], workers=2, iso=1)
        took = time.monotonic() - self.began
        interrupter.join()
        return took

    def silent(self, method):
        """A server that answers no request of that method."""

        def respond(handler, _):
            self.seen.append(handler.command)
            if handler.command == method:
                self.waits.set()
                self.over.wait(50)
            return 201, {"Location": "/v1/uploads/7"}, b""

        return FakeServer(respond)

    def test_while_the_server_is_busy(self):
        def respond(*_):
            self.waits.set()
            return 503, {"Retry-After": "40"}, b""

        with FakeServer(respond) as server:
            self.assertLess(self.interrupted(server.url, b"volume"), 5)

    def test_while_the_server_reads_an_upload(self):
        with self.silent("POST") as server:
            self.assertLess(self.interrupted(server.url, b"volume"), 5)
            self.over.set()

    def test_while_a_large_upload_is_sent_which_is_cancelled(self):
        with self.silent("PATCH") as server:
            self.assertLess(self.interrupted(server.url, bytes(9 << 20)), 5)
            self.over.set()
        self.assertEqual(sorted(self.seen), ["DELETE", "DELETE", "PATCH", "PATCH", "POST", "POST"])

    def test_while_a_body_gets_stuck(self):
        """The server takes the beginning of each request only."""
        held = []

        def serve():
            with contextlib.suppress(OSError):
                while True:
                    held.append(listener.accept()[0])
                    held[-1].recv(100)
                    self.waits.set()

        with socket.create_server(("127.0.0.1", 0)) as listener:
            thread = threading.Thread(target=serve)
            thread.start()
            self.addCleanup(lambda: [each.close() for each in held])
            url = f"http://127.0.0.1:{listener.getsockname()[1]}"
            self.assertLess(self.interrupted(url, bytes(7 << 20)), 5)
            listener.shutdown(socket.SHUT_RDWR)
            thread.join()

    def test_while_nothing_accepts_connections(self):
        with socket.create_server(("127.0.0.1", 0), backlog=1) as listener, contextlib.ExitStack() as others:
            for _ in range(8):  # the queue of connections is full
                other = others.enter_context(socket.socket())
                other.setblocking(False)
                with contextlib.suppress(BlockingIOError):
                    other.connect(listener.getsockname())
            threading.Timer(0.5, self.waits.set).start()
            self.assertLess(self.interrupted(f"http://127.0.0.1:{listener.getsockname()[1]}", b"volume"), 5)


if __name__ == "__main__":
    unittest.main()
