"""Meshes that are made in this process, and the package that does it, which the build has put together."""

import itertools
import multiprocessing
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

import isomesh_client
import numpy
from limits import LimitedTest
from support import DAEMON, DaemonTest, ball, turned

BUILT = Path(os.environ.get("ISOMESH_KERNELS", DAEMON.parent.parent / "python"))
if not (BUILT / "src" / "isomesh_kernels" / "_kernels.so").exists():
    raise SystemExit(f"{BUILT} has no isomesh_kernels: cmake --build --preset tests --target isomesh_python")
sys.path.insert(0, str(BUILT / "src"))

import isomesh_kernels  # noqa: E402


def atlas(kind="int16"):
    labels = numpy.zeros((26, 22, 18), kind)
    labels[3:14, 4:18, 3:15] = 3
    labels[14:23, 4:18, 3:15] = 9
    labels[8:18, 9:14, 7:12] = 40
    return labels


class SameAsTheServer(DaemonTest):
    limit_s = 60

    def expect_same(self, array, kernels_only=None, **keywords):
        served = self.client.mesh(array, **keywords)
        made = isomesh_kernels.mesh(array, **keywords, **(kernels_only or {}))
        self.assertGreater(len(made.faces), 100)
        for name, kind in (("vertices", "float32"), ("faces", "uint32"), ("labels", None), ("colors", "uint8")):
            one, other = getattr(served, name), getattr(made, name)
            self.assertEqual(one is None, other is None, name)
            if one is not None:
                self.assertEqual((other.dtype, other.shape), (kind or one.dtype, one.shape), name)
                self.assertEqual(one.tobytes(), other.tobytes(), name)
        measured = [dict(each.job["mesh"]) for each in (served, made)]
        for each in measured:
            each.pop("files")
            each["quality"] = {name: value for name, value in each["quality"].items() if name != "self_intersections"}  # of files
            proof = each.pop("certificate", None) or {}
            each["proof"] = bool(proof.get("proven")), proof.get("bound_mm")
            for label in each.get("labels", []):
                label.pop("files", None)
        self.assertEqual({name: measured[1].get(name) for name in measured[0]}, measured[0])
        return made

    def test_iso_values(self):
        scan = ball()
        for keywords in (
            {"iso": -9},
            {"iso": -9, "spacing": (0.5, 0.75, 1.5), "scheme": "bcc", "passes": 0},
            {"iso": -9.25, "affine": turned(), "smoothing": "taubin", "passes": 20, "close": True},
            {"iso": -9, "affine": [[0, 0, 2, 5], [-1, 0, 0, 30], [0, 1.5, 0, -7], [0, 0, 0, 1]], "scheme": 5},
            {"iso": -14, "close": True, "scheme": "5", "regularize": False, "interpolation": "midpoint"},
            {"iso": -9, "max_error_mm": 0.1},
            {"iso": -9, "triangles": 500, "untangle": True},
            {"iso": -9, "crop": [[-1e3, -1e3, -1e3], [1e3, 10, 1e3]], "components": {"keep": 1}},
        ):
            if keywords.get("scheme") == "5":
                keywords["scheme"] = 5
            with self.subTest(str(keywords)):
                self.expect_same(scan, **keywords)
        self.expect_same(scan, iso="otsu")

    def test_types_and_orders(self):
        scan = (ball() * 7 + 100).round()
        for kind in ("uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64", ">i2", "int64", "float16"):
            array = scan.clip(0, 100).astype(kind)
            with self.subTest(kind):
                self.expect_same(array, iso=40)
        self.expect_same((scan > 40), iso=0.5)
        holes = scan.astype("float32")
        holes[:3], holes[5, 5, 5] = numpy.nan, numpy.inf
        with self.assertWarns(isomesh_client.VolumeWarning):
            made = self.expect_same(holes, iso="otsu", passes=1)
        self.assertIn("non-finite-samples", [each["code"] for each in made.notes])
        with self.assertRaisesRegex(ValueError, "8 of the 8 samples are not finite"):
            isomesh_kernels.mesh(numpy.full((2, 2, 2), numpy.nan), iso=1)

    def test_labels(self):
        for keywords in (
            {"labels": "all"},
            {"labels": [3, 40], "close": True, "label_names": {3: "left"}, "label_colors": {40: "#102030"}},
            {"labels": "all", "max_error_mm": 0.3, "spacing": (1, 1, 2)},
            {"labels": "all", "smoothing": "laplacian", "passes": 8, "background": 3},
        ):
            with self.subTest(str(keywords)):
                self.expect_same(atlas(), **keywords)
        self.expect_same(atlas("float32"), labels="all")
        self.expect_same(atlas("uint32") * numpy.uint32(100_000_000), labels="all")

    def test_a_preset_has_a_name(self):
        scan = (ball() * 50 + 800).astype("int16")
        made = self.expect_same(scan, modality="ct", iso="bone")
        self.assertEqual(made.job["mesh"]["iso"], 250)

    def test_errors_are_the_servers_sentences(self):
        for array, keywords in (
            (ball(), {"iso": -9, "passes": 1001}),
            (ball(), {"iso": "bone"}),
            (ball(), {"iso": -9, "crop": [[500, 500, 500], [501, 501, 501]]}),
            (ball(), {"iso": -9, "lambda_": 0.5, "smoothing": "hc", "pass_band": 2}),
            (atlas(), {"labels": [4]}),
            (atlas()[:, :, :1], {"labels": "all"}),
            (ball(), {"labels": "all"}),
            (ball(), {"iso": -9, "spacing": (1e-9, 1e9, 1)}),
        ):
            with self.subTest(str(keywords)):
                with self.assertRaises((isomesh_client.Refused, isomesh_client.JobFailed)) as served:
                    self.client.mesh(array, **keywords)
                with self.assertRaises(ValueError) as made:
                    isomesh_kernels.mesh(array, **keywords)
                self.assertIn(str(made.exception), str(served.exception))


class InThisProcess(LimitedTest):
    limit_s = 60

    def test_samples_are_read_where_they_are(self):
        scan = ball()
        in_place = [
            (numpy.asfortranarray(scan), {}),
            (numpy.ascontiguousarray(scan.transpose()), {"axes": "zyx"}),
            (numpy.asfortranarray(scan > -9), {}),
            (numpy.asfortranarray(scan)[:, :, 3:], {}),
        ]
        copied = [(scan, {}), (numpy.asfortranarray(scan)[3:], {}), (scan.astype("int64"), {}), (scan.astype(">f8"), {"axes": "zyx"})]
        for arrays, codes in ((in_place, []), (copied, ["copied"])):
            for array, keywords in arrays:
                array.flags.writeable = False
                made = isomesh_kernels.mesh(array, iso=0.5 if array.dtype == bool else -9, passes=0, **keywords)
                self.assertEqual([each["code"] for each in made.notes], codes)
        axes = [isomesh_kernels.mesh(array, iso=-9, **keywords) for array, keywords in (copied[0], in_place[0], in_place[1])]
        self.assertEqual(len({(each.vertices.tobytes(), each.faces.tobytes()) for each in axes}), 1)

    def test_the_order_of_axes_does_not_matter(self):
        """All 48 orders of the axes of one volume."""
        scan = numpy.random.default_rng(1).random((9, 8, 7), "float32")
        labels = atlas()[::2, ::2, ::2]
        affine = numpy.array([[-0.75, 0, 0, 30], [0, -1, 0, -8], [0, 0, 1.5, 4], [0, 0, 0, 1]])
        for array, keywords in ((scan, {"iso": 0.6}), (scan, {"iso": 0.6, "scheme": 5, "close": True}), (labels, {"labels": "all"})):
            meshes = set()
            for axes in itertools.permutations(range(3)):
                for signs in itertools.product((1, -1), repeat=3):
                    place = numpy.zeros((4, 4))
                    place[3, 3] = 1
                    for column, (axis, sign) in enumerate(zip(axes, signs)):
                        place[axis, column] = sign
                        place[axis, 3] = 0 if sign > 0 else array.shape[axis] - 1
                    stored = array.transpose(axes)[tuple(slice(None, None, sign) for sign in signs)]
                    made = isomesh_kernels.mesh(stored, affine=affine @ place, **keywords)
                    meshes.add((made.vertices.tobytes(), made.faces.tobytes()))
            self.assertEqual(len(meshes), 1, keywords)

    def test_arrays_are_the_memory_of_the_kernels(self):
        made = isomesh_kernels.mesh(ball(), iso=-9)
        vertices, before = made.vertices, made.vertices.copy()
        self.assertFalse(vertices.flags.owndata)
        del made
        other = isomesh_kernels.mesh(ball(), iso=-5)
        self.assertTrue((vertices == before).all())
        vertices += 1
        self.assertTrue((vertices == before + 1).all())
        self.assertIn(f"<Mesh of {len(other.faces)} triangles", repr(other))
        target = Path(tempfile.mkdtemp()) / "ball.ply"
        self.addCleanup(shutil.rmtree, target.parent)
        self.assertEqual(isomesh_client.read_ply(other.save(target)).faces.tobytes(), other.faces.tobytes())

    def test_other_threads_run_and_progress_is_told(self):
        shares, counted, ended = [], [0], threading.Event()

        def count():
            while not ended.is_set():
                counted[0] += 1
                time.sleep(0.001)

        thread = threading.Thread(target=count)
        thread.start()
        made = isomesh_kernels.mesh(ball((160, 160, 160), 70), iso=-70, passes=30, progress=lambda share: shares.append((share, counted[0])))
        ended.set()
        thread.join()
        self.assertGreater(len(made.faces), 100_000)
        self.assertEqual(shares[-1][0], 1)
        self.assertEqual(sorted(shares), shares)
        self.assertGreater(shares[-1][1], 3)

    def test_several_at_once(self):
        alone = isomesh_kernels.mesh(ball(), iso=-9).vertices.tobytes()
        found = []
        threads = [threading.Thread(target=lambda: found.append(isomesh_kernels.mesh(ball(), iso=-9))) for _ in range(4)]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
        self.assertEqual([each.vertices.tobytes() == alone for each in found], [True] * 4)

    def test_an_interrupt_ends_it(self):
        code = """
import numpy, sys, isomesh_kernels
scan = numpy.random.default_rng(1).random((220, 220, 220), "float32")
def told(share):
    print("begun", flush=True)
try:
    isomesh_kernels.mesh(scan, iso=0.5, passes=1000, progress=told)
except KeyboardInterrupt:
    print("interrupted", len(isomesh_kernels.mesh(scan[:9, :9, :9], iso=0.5).faces) > 0)
"""
        program = subprocess.Popen(
            [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        )
        self.assertEqual(program.stdout.readline(), "begun\n")
        program.send_signal(signal.SIGINT)
        self.assertEqual(program.communicate()[0].splitlines()[-1], "interrupted True")

    def test_a_forked_process_is_told(self):
        """The threads of the kernels do not exist there: it would wait for them for ever."""
        isomesh_kernels.mesh(ball(), iso=-9)
        with multiprocessing.get_context("fork").Pool(1) as pool, self.assertRaisesRegex(RuntimeError, 'get_context."spawn"'):
            pool.apply(isomesh_kernels.mesh, [ball()], {"iso": -9})

    def test_an_exception_of_progress_ends_it(self):
        def fail(_):
            raise ZeroDivisionError

        with self.assertRaises(ZeroDivisionError):
            isomesh_kernels.mesh(ball(), iso=-9, progress=fail)

    def test_mistakes(self):
        for array, keywords, kind, text in (
            (ball(), {"iso": 1, "pases": 3}, TypeError, "mesh.. has no parameter 'pases'; did you mean 'passes'"),
            (ball(), {"iso": 1, "formats": ["stl"]}, TypeError, "no parameter 'formats'"),
            ("head.nii.gz", {}, TypeError, "cannot mesh a str: give a numpy array"),
            (ball()[0], {}, ValueError, "three axes"),
            (ball().astype(complex), {}, TypeError, "samples of type complex"),
            (ball(), {"axes": "yxz"}, ValueError, "axes must be 'xyz' or 'zyx'"),
            (ball(), {"modality": "mr"}, ValueError, "modality must be 'ct'"),
            (ball(), {"iso": -9, "memory_bytes": 1000}, MemoryError, "the surface has .* 0 MiB are allowed"),
        ):
            with self.subTest(text), self.assertRaisesRegex(kind, text):
                isomesh_kernels.mesh(array, **keywords)
        reason = r"the iso-value 5 separates none of the samples of the volume, which range from .* suggested iso-value is -"
        with self.assertRaisesRegex(isomesh_client.EmptySurface, reason):
            isomesh_kernels.mesh(ball(), iso=5)
        empty = isomesh_kernels.mesh(ball(), iso=5, allow_empty=True)
        self.assertEqual((empty.vertices.shape, empty.faces.shape), ((0, 3), (0, 3)))
        with self.assertRaisesRegex(ValueError, "at least 1, not 0"):
            isomesh_kernels.set_threads(0)


class LikeZmesh(LimitedTest):
    """The calls of zmesh's README."""

    limit_s = 60

    def test_labels_one_by_one(self):
        mesher = isomesh_kernels.Mesher((4, 4, 40))
        mesher.mesh(atlas(), close=True, passes=0)
        self.assertEqual(mesher.ids(), [3, 9, 40])
        self.assertEqual(repr(mesher), "<Mesher of 3 labels>")
        whole = isomesh_kernels.mesh(atlas(), spacing=(4, 4, 40), labels="all", close=True, passes=0)
        for label in mesher.ids():
            mesh = mesher.get(label, normals=False)
            faces = whole.faces[whole.labels == label]
            self.assertEqual(mesh.triangles().tolist(), whole.vertices[faces].tolist())
            self.assertEqual(len(numpy.unique(mesh.faces)), len(mesh.vertices))
            self.assertEqual(mesh.normals.shape, mesh.vertices.shape)
        low, high = mesher.get(9).bounds  # voxels 14 to 22 along x, 4 to 17 along y, 3 to 14 along z
        self.assertTrue((abs(low - numpy.array([13.5 * 4, 3.5 * 4, 2.5 * 40])) < [2, 2, 20]).all(), low)
        self.assertTrue((abs(high - numpy.array([22.5 * 4, 17.5 * 4, 14.5 * 40])) < [2, 2, 20]).all(), high)
        moved = mesher.get(9, voxel_centered=True).bounds - mesher.get(9).bounds
        self.assertEqual(moved.tolist(), [[2, 2, 20]] * 2)
        mesher.erase(9)
        self.assertEqual(mesher.ids(), [3, 40])
        with self.assertRaisesRegex(KeyError, "no mesh of the label 9"):
            mesher.get(9)

    def test_fewer_triangles(self):
        mesher = isomesh_kernels.Mesher((1, 1, 1))
        mesher.mesh(atlas(), close=True)
        fewer = {label: mesher.get(label, reduction_factor=10, max_error=0.5) for label in mesher.ids()}
        before = sum(len(mesher.get(label).faces) for label in mesher.ids())
        after = sum(len(each.faces) for each in fewer.values())
        self.assertLess(after, before / 4)
        # A wall is the same on both sides.
        shared = {tuple(each) for each in fewer[3].vertices.tolist()} & {tuple(each) for each in fewer[9].vertices.tolist()}
        self.assertGreater(len(shared), 3)

    def test_ids_of_64_bits(self):
        ids = {0: 0, 3: 5, 9: 2**40, 40: 2**63 + 7}
        labels = numpy.zeros((26, 22, 18), "uint64")
        for small, large in ids.items():
            labels[atlas() == small] = large
        mesher = isomesh_kernels.Mesher((1, 1, 1))
        mesher.mesh(labels)
        self.assertEqual(mesher.ids(), [5, 2**40, 2**63 + 7])
        small = isomesh_kernels.Mesher((1, 1, 1))
        small.mesh(atlas("int64"))
        self.assertEqual(len(mesher.get(5).faces), len(small.get(3).faces))
        self.assertEqual(mesher.get(2**63 + 7).bounds.tolist(), small.get(40).bounds.tolist())
        mesher.mesh(numpy.where(atlas() == 3, -(2**40), atlas().astype("int64")))
        self.assertEqual(mesher.ids(), [-(2**40), 9, 40])
        self.assertEqual(mesher.get(-(2**40)).bounds.tolist(), small.get(3).bounds.tolist())

    def test_files(self):
        mesher = isomesh_kernels.Mesher((1, 1, 1))
        mesher.mesh(atlas())
        mesh = mesher.get(3)
        data = mesh.to_precomputed()
        count = int.from_bytes(data[:4], "little")
        self.assertEqual((count, len(data)), (len(mesh.vertices), 4 + 12 * len(mesh.vertices) + 12 * len(mesh.faces)))
        self.assertEqual(isomesh_client.read_ply(mesh.to_ply()).faces.tolist(), mesh.faces.tolist())
        lines = mesh.to_obj().decode().splitlines()
        self.assertEqual(sum(line.startswith("f ") for line in lines), len(mesh.faces))
        mesher.mesh(numpy.zeros((4, 4, 4), "uint8"))
        self.assertEqual(mesher.ids(), [])
        with self.assertRaisesRegex(TypeError, "labels are integers, not float32"):
            mesher.mesh(ball())


class Package(LimitedTest):
    def test_a_wheel_carries_its_libraries(self):
        """Made without a network, and used without the build."""
        with tempfile.TemporaryDirectory() as folder:
            source, to = Path(folder, "source"), Path(folder, "to")
            shutil.copytree(BUILT, source, symlinks=False)
            environment = {**os.environ, "PIP_DISABLE_PIP_VERSION_CHECK": "1", "PIP_ROOT_USER_ACTION": "ignore"}
            pip = [sys.executable, "-m", "pip", "--quiet", "wheel", "--no-deps", "--no-index"]
            subprocess.check_call([*pip, "--wheel-dir", folder, source], env=environment)
            (wheel,) = Path(folder).glob("*.whl")
            self.assertRegex(wheel.name, r"^isomesh_kernels-[\d.]+-py3-none-linux_x86_64\.whl$")
            subprocess.check_call([sys.executable, "-m", "zipfile", "-e", wheel, to])
            shutil.rmtree(source)
            linked = subprocess.check_output(["ldd", to / "isomesh_kernels" / "_kernels.so"], text=True)
            outside = {line.split()[0] for line in linked.splitlines() if "=>" in line and str(to) not in line}
            self.assertEqual(outside, {"libstdc++.so.6", "libm.so.6", "libgcc_s.so.1", "libc.so.6"})
            code = "import isomesh_kernels, numpy; print(isomesh_kernels.__file__, isomesh_kernels.mesh(numpy.eye(9)[..., None] * numpy.ones(9), iso=0.5))"
            path = os.pathsep.join([str(to), *(each for each in sys.path if str(BUILT) not in each)])
            printed = subprocess.check_output([sys.executable, "-c", code], text=True, env={**os.environ, "PYTHONPATH": path})
            self.assertRegex(printed, rf"^{to}/isomesh_kernels/__init__.py <Mesh of \d+ triangles")

    def test_the_examples_of_its_readme_run(self):
        text = (BUILT / "README.md").read_text()
        code = "\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL))
        self.assertGreater(code.count("mesh"), 10)
        with tempfile.TemporaryDirectory() as folder:
            environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
            printed = subprocess.check_output([sys.executable, "-c", code], cwd=folder, env=environment, text=True)
            self.assertRegex(printed, r"^<Mesh of \d+ triangles and \d+ vertices, mm, LPS>\n")
            self.assertEqual(sorted(each.name for each in Path(folder).iterdir()), ["1099511627776:0", "7:0", "ball.ply"])

    def test_its_version_is_the_clients(self):
        self.assertEqual(isomesh_kernels.__version__, isomesh_client.__version__)

    def test_types_hold(self):
        environment = {**os.environ, "MYPYPATH": str(Path(isomesh_client.__file__).parents[1])}
        mypy = [sys.executable, "-m", "mypy", "--config-file", BUILT / "pyproject.toml", "--no-error-summary", "--cache-dir", os.devnull]
        subprocess.check_call([*mypy, BUILT / "src" / "isomesh_kernels"], env=environment)


if __name__ == "__main__":
    unittest.main()
