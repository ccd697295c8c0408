"""What a mesh can do: its arrays, notes, files, and other packages' meshes."""

import contextlib
import copy
import io
import json
import pickle
import subprocess
import sys
import tempfile
import unittest
import warnings
from pathlib import Path
from unittest import mock

import isomesh_client
import nibabel
import numpy
from limits import LimitedTest
from support import DaemonTest, ball, thin_shell


def tetrahedron(labels=None):
    vertices = numpy.array([[0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 4]], "float32")
    faces = numpy.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], "uint32")
    return isomesh_client.Mesh(vertices, faces, labels)


class Arrays(LimitedTest):
    def test_the_arrays_belong_to_the_caller(self):
        mesh = tetrahedron()
        mesh.vertices += 1
        self.assertEqual(mesh.vertices[0].tolist(), [1, 1, 1])
        mesh.vertices = mesh.vertices * 2
        self.assertEqual(mesh.bounds.tolist(), [[2, 2, 2], [6, 8, 10]])
        mesh.faces = mesh.faces[:2]
        self.assertEqual(repr(mesh), "<Mesh of 2 triangles and 4 vertices, mm, LPS>")

    def test_another_space_is_a_copy(self):
        mesh = tetrahedron(numpy.array([1, 1, 2, 2], "int32"))
        for space in ("lps", "ras"):
            copied = mesh.in_space(space)
            copied.vertices += 1
            copied.faces[0] = 0
            copied.labels += 1
        self.assertEqual(mesh.vertices.sum(), 9)
        self.assertEqual(mesh.faces[0].tolist(), [0, 2, 1])
        self.assertEqual(mesh.labels.tolist(), [1, 1, 2, 2])
        self.assertEqual(mesh.in_space("ras").vertices[1].tolist(), [-2, 0, 0])
        with self.assertRaisesRegex(ValueError, "'ras' or 'lps', not 'mni'"):
            mesh.in_space("mni")

    def test_bounds(self):
        self.assertEqual(tetrahedron().bounds.tolist(), [[0, 0, 0], [2, 3, 4]])
        self.assertEqual(tetrahedron().in_space("ras").bounds.tolist(), [[-2, -3, 0], [0, 0, 4]])
        empty = isomesh_client.Mesh(numpy.zeros((0, 3), "float32"), numpy.zeros((0, 3), "uint32"))
        self.assertEqual(empty.bounds.tolist(), [[0, 0, 0], [0, 0, 0]])
        self.assertEqual(empty.normals.shape, (0, 3))

    def test_normals_are_weighted_by_areas(self):
        mesh = tetrahedron()
        # The faces at vertex 0 lie in the planes z = 0, y = 0 and x = 0, and have the areas 3, 4 and 6.
        expected = -numpy.array([6, 4, 3]) / numpy.sqrt(61)
        numpy.testing.assert_allclose(mesh.normals[0], expected, rtol=1e-6)
        self.assertEqual((mesh.normals.dtype, mesh.normals.shape), ("float32", (4, 3)))
        mesh.vertices = numpy.vstack([mesh.vertices, [[9, 9, 9]]])
        self.assertEqual(mesh.normals[4].tolist(), [0, 0, 0])

    def test_a_mesh_without_a_job_says_so(self):
        with self.assertRaisesRegex(AttributeError, "has no job"):
            tetrahedron().job
        self.assertEqual(list(tetrahedron().notes), [])


class PlyFiles(LimitedTest):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def test_the_space_of_a_file_is_read_from_its_comment(self):
        file = self.folder / "ras.ply"
        data = tetrahedron().in_space("ras").save(file).read_bytes()
        self.assertIn(b"\ncomment isomesh, millimetres, SPACE=RAS\n", data)
        for told, space in ((b"millimetres, RAS", "ras"), (b"angstrom, SPACE=RAS", "ras"), (b"millimetres, LPS", "lps")):
            file.write_bytes(data.replace(b"millimetres, SPACE=RAS", told))
            self.assertEqual(isomesh_client.read_ply(file).space, space)

    def test_a_ply_file_has_the_arrays_as_they_are(self):
        for labels in (None, numpy.array([1, 1, -2, 2], "int32"), numpy.array([1, 2, 3, 4294967295], "uint32")):
            mesh = tetrahedron(labels).in_space("ras")
            mesh.vertices += 1
            path = mesh.save(self.folder / "changed.PLY")
            again = isomesh_client.read_ply(path)
            self.assertEqual(again.space, "ras")
            self.assertTrue(numpy.array_equal(again.vertices, mesh.vertices))
            self.assertTrue(numpy.array_equal(again.faces, mesh.faces))
            self.assertEqual(again.labels if labels is None else again.labels.tolist(), labels if labels is None else labels.tolist())
            self.assertEqual(again.vertices.dtype, "float32")

    def test_arrays_that_are_no_mesh_are_rejected(self):
        for name, value, text in (
            ("vertices", numpy.zeros((4, 2)), r"vertices must have the shape \('n', 3\)"),
            ("faces", numpy.zeros(3, int), "faces must have the shape"),
            ("faces", numpy.array([[0, 1, 4]]), "faces must be from 0 to 3"),
            ("faces", numpy.array([[0, 1, -1]]), "faces must be from 0 to 3"),
            ("faces", numpy.array([[0, 1, 2.5]]), "faces must be integers"),
            ("labels", numpy.zeros(3, int), "3 labels for 4 faces"),
        ):
            mesh = tetrahedron()
            setattr(mesh, name, value)
            with self.subTest(text), self.assertRaisesRegex(ValueError, text):
                mesh.save(self.folder / "wrong.ply")
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_a_damaged_ply_file_is_rejected(self):
        points = numpy.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "float32")
        with tempfile.TemporaryDirectory() as folder:
            path = isomesh_client.Mesh(points, numpy.array([[0, 1, 2]], "uint32")).save(Path(folder, "one.ply"))
            whole = path.read_bytes()
        corner = whole.rindex(b"\x02\0\0\0")
        for damaged in (
            whole.replace(b"element vertex 3", b"element vertex x"),
            whole.replace(b"element vertex 3", b"element vertex -3"),
            whole.replace(b"element face 1\n", b"element face\n"),
            whole[:corner] + b"\x03\0\0\0",
            whole[:-1],
        ):
            for without in ({}, {"numpy": None}):
                with mock.patch.dict(sys.modules, without), self.assertRaises(isomesh_client.WrongAnswer):
                    isomesh_client.read_ply(damaged)

    def test_other_formats_need_a_job(self):
        with self.assertRaisesRegex(ValueError, "saved as .ply only"):
            tetrahedron().save(self.folder / "a.stl")
        with self.assertRaisesRegex(ValueError, "'a.fbx' is not a mesh format; the formats are drc, .*ply.*off"):
            tetrahedron().save(self.folder / "a.fbx")
        with self.assertRaisesRegex(ValueError, "'a' is not a mesh format"):
            tetrahedron().save("a")


# The signature of trimesh 4's constructor, as far as it concerns this package.
TRIMESH = """
class Trimesh:
    def __init__(self, vertices=None, faces=None, face_normals=None, vertex_normals=None, face_colors=None,
                 vertex_colors=None, face_attributes=None, vertex_attributes=None, metadata=None, process=True,
                 validate=False):
        self.given = {name: value for name, value in locals().items() if name != "self"}
"""


class OtherPackages(LimitedTest):
    def test_to_trimesh(self):
        module = type(sys)("trimesh")
        exec(TRIMESH, module.__dict__)
        for labels in (None, numpy.array([1, 1, 2, 2], "int32")):
            mesh = tetrahedron(labels)
            with mock.patch.dict(sys.modules, {"trimesh": module}):
                given = mesh.to_trimesh().given
            self.assertIs(given["process"], False)
            self.assertEqual(given["faces"].dtype, "int64")
            self.assertTrue(numpy.array_equal(given["faces"], mesh.faces))
            self.assertTrue(numpy.array_equal(given["vertices"], mesh.vertices))
            self.assertEqual(given["metadata"], {"units": "mm", "space": "lps"})
            given["vertices"] += 1
            self.assertEqual(mesh.vertices.sum(), 9, "the vertices are shared")
            self.assertEqual({name: each.tolist() for name, each in given["face_attributes"].items()},
                             {} if labels is None else {"label": [1, 1, 2, 2]})

    def test_to_trimesh_tells_the_unit_of_the_volume(self):
        module = type(sys)("trimesh")
        exec(TRIMESH, module.__dict__)
        mesh = tetrahedron()
        mesh.notes = [{"code": "unit-angstrom", "detail": "in angstrom"}]
        with mock.patch.dict(sys.modules, {"trimesh": module}):
            self.assertEqual(mesh.to_trimesh().given["metadata"]["units"], "angstrom")

    def test_to_vtk(self):
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkFiltersCore import vtkMassProperties

        mesh = tetrahedron(numpy.array([1, 1, 2, 2], "int32"))
        surface = mesh.to_vtk()
        properties = vtkMassProperties()
        properties.SetInputData(surface)
        self.assertAlmostEqual(properties.GetVolume(), 4)
        points = vtk_to_numpy(surface.GetPoints().GetData())
        self.assertEqual(points.dtype, "float32")
        self.assertTrue(numpy.array_equal(points, mesh.vertices))
        corners = vtk_to_numpy(surface.GetPolys().GetConnectivityArray())
        self.assertEqual(corners.dtype, "int64")
        self.assertTrue(numpy.array_equal(corners.reshape(-1, 3), mesh.faces))
        self.assertEqual(vtk_to_numpy(surface.GetCellData().GetArray("label")).tolist(), [1, 1, 2, 2])
        mesh.vertices += 1
        self.assertEqual(points.sum(), 9, "the points are shared")
        self.assertIsNone(tetrahedron().to_vtk().GetCellData().GetScalars())

    def test_a_missing_package_is_named(self):
        mesh = tetrahedron()
        for call, missing, text in (
            (mesh.to_trimesh, "trimesh", "mesh.to_trimesh.. needs the package trimesh; .*pip install trimesh"),
            (mesh.to_vtk, "vtkmodules.vtkCommonCore", "mesh.to_vtk.. needs the package vtk.*pip install vtk"),
            (lambda: mesh.normals, "numpy", "mesh.normals needs the package numpy"),
        ):
            with mock.patch.dict(sys.modules, {missing: None}), self.assertRaisesRegex(ImportError, text):
                call()


class Jobs(DaemonTest):
    def test_save_takes_the_format_from_the_suffix(self):
        mesh = self.client.mesh(ball(), iso=-8, formats=["glb", "stl"])
        self.assertEqual(mesh.save(self.folder / "ball.glb").read_bytes()[:4], b"glTF")
        self.assertEqual(mesh.save(str(self.folder / "ball.stl")).stat().st_size, 84 + 50 * len(mesh.faces))
        # The PLY file is written from the arrays, and is the server's to the byte.
        ours, theirs = mesh.save(self.folder / "ours.ply"), self.client.download(mesh.job, self.folder / "theirs.ply")
        self.assertEqual(ours.read_bytes(), theirs.read_bytes())
        with self.assertRaisesRegex(ValueError, r"no file of the format 'obj'; it has .*Add formats=\['obj'\]"):
            mesh.save(self.folder / "ball.obj")

    def test_a_changed_mesh_is_not_saved_as_the_servers(self):
        mesh = self.client.mesh(ball(), iso=-8, formats=["stl"])
        with self.assertRaisesRegex(ValueError, "is in RAS, and the server's .stl file in LPS: add space='ras'"):
            mesh.in_space("ras").save(self.folder / "turned.stl")
        in_ras = self.client.mesh(ball(), iso=-8, formats=["stl"], space="ras")
        self.assertTrue(numpy.array_equal(in_ras.vertices, mesh.in_space("ras").vertices))
        in_ras.save(self.folder / "ras.stl")
        original = mesh.vertices.copy()
        mesh.vertices += 1
        with self.assertRaisesRegex(ValueError, "the mesh was changed, and the server's .stl file was not"):
            mesh.save(self.folder / "changed.stl")
        self.assertEqual([each.name for each in self.folder.glob("*.stl")], ["ras.stl"])
        mesh.vertices = original
        mesh.save(self.folder / "restored.stl")

    def test_labels_are_saved(self):
        samples = numpy.zeros((12, 12, 12), "uint8")
        samples[2:6, 2:10, 2:10], samples[6:10, 2:10, 2:10] = 3, 7
        mesh = self.client.mesh(samples, labels="all", formats=["vtp", "zip"])
        self.assertEqual(mesh.save(self.folder / "labels.zip").read_bytes()[:2], b"PK")
        mesh.save(self.folder / "labels.vtp")
        again = isomesh_client.read_ply(mesh.save(self.folder / "labels.ply"))
        self.assertTrue(numpy.array_equal(again.labels, mesh.labels))
        # A label's own normals point out of it.
        of_label = isomesh_client.Mesh(mesh.vertices, mesh.faces[mesh.labels == 3])
        used = numpy.unique(of_label.faces)
        outward = mesh.vertices[used] - mesh.vertices[used].mean(0)
        self.assertGreater(numpy.einsum("ij,ij->i", outward, of_label.normals[used]).min(), 0)

    def test_each_label_has_vertices_and_colors_of_its_own(self):
        samples = numpy.zeros((12, 12, 12), "uint8")
        samples[2:6, 2:10, 2:10], samples[6:10, 2:10, 2:10] = 3, 7
        mesh = self.client.mesh(samples, labels="all", label_colors={7: "#ff0080"})
        used = [numpy.unique(mesh.faces[mesh.labels == label]) for label in (3, 7)]
        self.assertEqual(numpy.concatenate(used).tolist(), list(range(len(mesh.vertices))))
        self.assertEqual(numpy.unique(mesh.colors[used[1]], axis=0).tolist(), [[255, 0, 128]])
        self.assertEqual((mesh.colors.dtype, mesh.colors.shape), ("uint8", mesh.vertices.shape))
        shared = {tuple(each) for each in mesh.vertices[used[0]]} & {tuple(each) for each in mesh.vertices[used[1]]}
        self.assertGreater(len(shared), 9)
        outward = mesh.vertices[used[0]] - mesh.vertices[used[0]].mean(0)
        self.assertGreater(numpy.einsum("ij,ij->i", outward, mesh.normals[used[0]]).min(), 0)
        # The file is the server's to the byte, also without numpy.
        ours, theirs = mesh.save(self.folder / "own.ply"), self.client.download(mesh.job, self.folder / "server.ply")
        self.assertEqual(ours.read_bytes(), theirs.read_bytes())
        script = """
import json, sys
sys.modules["numpy"] = None
import isomesh_client
mesh = isomesh_client.read_ply(sys.argv[1])
mesh.in_space("ras").in_space("lps").save(sys.argv[2])
print(json.dumps([mesh.labels.tolist(), mesh.colors.tolist()]))
"""
        plain = self.folder / "plain.ply"
        found = subprocess.run([sys.executable, "-c", script, theirs, plain], check=True, capture_output=True, text=True)
        labels, colors = json.loads(found.stdout)
        self.assertEqual((labels, colors), (mesh.labels.tolist(), mesh.colors.tolist()))
        self.assertEqual(plain.read_bytes(), theirs.read_bytes())
        mesh.colors = mesh.colors[1:]
        with self.assertRaisesRegex(ValueError, "colors for .* vertices; set colors to None"):
            mesh.save(plain)
        mesh.colors = numpy.full(mesh.vertices.shape, 256)
        with self.assertRaisesRegex(ValueError, "colors must be from 0 to 255"):
            mesh.save(plain)
        mesh.colors = numpy.full(mesh.vertices.shape, 0.5)
        with self.assertRaisesRegex(ValueError, "colors must be integers from 0 to 255"):
            mesh.save(plain)
        # Without colours a label is a property of faces, as in the server's files before they had colours.
        mesh.colors = None
        self.assertIsNone(isomesh_client.read_ply(mesh.save(plain)).colors)
        self.assertIn(b"property list uchar uint vertex_indices\nproperty int label\nend_header\n", plain.read_bytes())
        self.assertEqual(isomesh_client.read_ply(plain).labels.tolist(), mesh.labels.tolist())

    def test_an_obj_of_labels_has_its_materials_beside_it(self):
        samples = numpy.zeros((12, 12, 12), "uint8")
        samples[2:6, 2:10, 2:10], samples[6:10, 2:10, 2:10] = 3, 7
        mesh = self.client.mesh(samples, labels="all", label_colors={7: "#ff0080"}, formats=["obj"])
        lines = mesh.save(self.folder / "two labels.obj").read_text().splitlines()
        self.assertEqual(lines[:3], ["# isomesh, millimetres, SPACE=LPS", "mtllib two_labels.mtl", "o label_3"])
        self.assertEqual(sum(line.startswith("f ") for line in lines), len(mesh.faces))
        materials = (self.folder / "two_labels.mtl").read_text()
        self.assertIn("newmtl label_7\nKd 1.000000 0.000000 0.501961\n", materials)
        self.client.mesh(ball(), iso=-8, formats=["obj"]).save(self.folder / "ball.obj")
        self.assertFalse((self.folder / "ball.mtl").exists())

    def test_normals_and_bounds_are_the_servers(self):
        mesh = self.client.mesh(ball(), iso=-8, passes=0)
        outward = mesh.vertices - mesh.vertices.mean(0)
        cosines = numpy.einsum("ij,ij->i", outward, mesh.normals) / numpy.linalg.norm(outward, axis=1)
        self.assertGreater(cosines.min(), 0.9)
        numpy.testing.assert_allclose(mesh.bounds, mesh.job["mesh"]["bounds"], atol=1e-5)

    def test_a_copy_has_no_connection(self):
        mesh = self.client.mesh(ball(), iso=-8, formats=["stl"])
        for copied in (pickle.loads(pickle.dumps(mesh)), copy.deepcopy(mesh)):
            self.assertTrue(numpy.array_equal(copied.vertices, mesh.vertices))
            self.assertEqual(copied.job["id"], mesh.job["id"])
            with self.assertRaisesRegex(ValueError, r"use client.download\(mesh.job, path\)"):
                copied.save(self.folder / "copy.stl")

    def test_a_stored_volume(self):
        volume = self.client.upload(ball())
        wanted = self.client.mesh(ball(), iso=-8)
        for source in (volume, volume["id"], self.client.volume(volume)):
            mesh = self.client.mesh(source, iso=-8)
            self.assertTrue(numpy.array_equal(mesh.vertices, wanted.vertices))
            self.assertEqual(mesh.job["volume"], volume["id"])
        for keywords, text in (
            ({"affine": numpy.eye(4)}, "affine: for uploads only"),
            ({"name": "a", "spacing": (1, 1, 1)}, "spacing, name: for uploads only"),
            ({"affine_space": "lps"}, "affine_space: for uploads only"),
        ):
            with self.assertRaisesRegex(ValueError, text):
                self.client.mesh(volume, iso=-8, **keywords)
        with self.assertRaises(isomesh_client.Refused) as refused:
            self.client.mesh("0" * 64, iso=1)
        self.assertEqual(refused.exception.status, 404)
        with self.assertRaisesRegex(TypeError, "not a volume"):
            self.client.mesh({"id": "x"}, iso=1)

    def test_an_empty_surface_is_an_error_unless_it_is_allowed(self):
        with self.assertRaisesRegex(isomesh_client.EmptySurface, "the surface is empty: .*; allow_empty=True") as refused:
            self.client.mesh(ball(), iso=1e6, formats=["stl"])
        job, file = refused.exception.job, self.folder / "none.stl"
        self.assertTrue(job["mesh"]["empty"])
        self.assertRaises(isomesh_client.EmptySurface, self.client.fetch, job)
        self.assertRaises(isomesh_client.EmptySurface, self.client.download, job["id"], file)
        without = self.client.wait(self.client.submit(job["volume"], iso=1e6, formats=["glb"]))
        self.assertRaises(isomesh_client.EmptySurface, self.client.fetch, without)
        self.assertRaises(isomesh_client.EmptySurface, self.client.download, without, file)
        self.assertFalse(file.exists())
        self.assertEqual(len(self.client.fetch(job, allow_empty=True).faces), 0)
        (result,) = self.client.mesh_all([ball()], to=lambda _: file, iso=1e6)
        self.assertIsInstance(result.error, isomesh_client.EmptySurface)
        self.assertFalse(file.exists())
        (result,) = self.client.mesh_all([ball()], to=lambda _: file, iso=1e6, allow_empty=True)
        self.assertEqual((result.error, file.stat().st_size), (None, 84))

    def test_an_empty_surface_that_is_allowed_is_a_mesh(self):
        mesh = self.client.mesh(ball(), iso=1e6, formats=["stl"], allow_empty=True)
        self.assertTrue(mesh.job["mesh"]["empty"])
        self.assertEqual(mesh.save(self.folder / "empty.stl").stat().st_size, 84)
        self.assertEqual((mesh.vertices.shape, mesh.faces.shape), ((0, 3), (0, 3)))

    def test_progress(self):
        seen = []
        self.client.mesh(ball(), iso=-8, progress=seen.append)
        self.assertEqual((seen[-1]["state"], seen[-1]["progress"]), ("succeeded", 1))

    def test_an_exception_of_progress_cancels_the_job(self):
        noise = numpy.random.default_rng(3).random((128, 128, 96), "float32")
        seen = []

        def stop(job):
            seen.append(job)
            raise LookupError("enough")

        with self.assertRaisesRegex(LookupError, "enough"):
            self.client.mesh(noise, iso=0.5, passes=1000, progress=stop)
        with self.assertRaisesRegex(isomesh_client.JobFailed, "cancelled"):
            self.client.wait(seen[0])


class Notes(DaemonTest):
    def forms_differ(self):
        image = nibabel.Nifti1Image(ball(), numpy.eye(4))
        image.set_sform(numpy.eye(4), 1)
        moved = numpy.eye(4)
        moved[0, 3] = 360
        image.set_qform(moved, 1)
        file = self.folder / "differs.nii.gz"
        nibabel.save(image, file)
        return file

    def test_a_note_is_a_warning_and_in_the_mesh(self):
        file = self.forms_differ()
        with self.assertWarnsRegex(isomesh_client.VolumeWarning, r"^differs.nii.gz: .*360.*\(forms-differ\)$") as warned:
            mesh = self.client.mesh(file, iso=-8, passes=0)
        self.assertEqual(warned.filename, __file__, "the warning is not at the caller's line")
        self.assertEqual([note["code"] for note in mesh.notes], ["forms-differ"])
        self.assertIn("360", mesh.notes[0]["detail"])
        with self.assertWarns(isomesh_client.VolumeWarning) as warned:
            volume = self.client.upload(file)
        self.assertEqual(warned.filename, __file__)
        with self.assertWarns(isomesh_client.VolumeWarning):
            self.assertEqual(self.client.mesh(volume["id"], iso=-8, passes=0).notes, mesh.notes)
        with self.assertWarns(isomesh_client.VolumeWarning):
            self.client.upload_all(file)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            self.assertEqual(self.client.mesh(volume, iso=-8, passes=0).notes, mesh.notes, "a volume's owner has its notes")
            self.assertEqual(self.client.fetch(mesh.job).notes, mesh.notes)
        self.assertEqual(mesh.in_space("ras").notes, mesh.notes)
        self.client.erase(volume)
        self.assertEqual(list(self.client.fetch(mesh.job).notes), [])

    def test_a_note_on_the_mesh_follows_those_on_its_volume(self):
        with self.assertWarnsRegex(isomesh_client.VolumeWarning, r"^the mesh: 1 cavity .*\(thin-walls\)$"):
            mesh = self.client.mesh(thin_shell(), iso=0.5, close=True, scheme=6, passes=0)
        codes = [note["code"] for note in mesh.notes]
        self.assertEqual(codes.count("thin-walls"), 1)
        self.assertEqual(codes[-1], "thin-walls")
        self.assertEqual(self.client.fetch(mesh.job).notes, mesh.notes)
        self.client.erase(mesh.job["volume"])
        self.assertEqual([note["code"] for note in self.client.fetch(mesh.job).notes], ["thin-walls"])

    def test_a_script_prints_the_warning_with_its_line(self):
        script = self.folder / "script.py"
        script.write_text(f"import isomesh_client\nisomesh_client.Client({self.url!r}).upload({str(self.forms_differ())!r})\n")
        found = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
        self.assertRegex(found.stderr, r"script.py:2: VolumeWarning: differs.nii.gz: .*360")

    def test_labels_are_not_advised_to_who_asks_for_labels(self):
        samples = numpy.zeros((12, 12, 12), "uint8")
        samples[2:10, 2:6, 2:6], samples[2:10, 6:10, 2:6] = 1, 2
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            mesh = self.client.mesh(samples, labels="all")
        self.assertEqual([note["code"] for note in mesh.notes], ["looks-like-labels"])
        with self.assertWarnsRegex(isomesh_client.VolumeWarning, "looks-like-labels"):
            self.client.mesh(samples, iso=0.5)


class Limits(LimitedTest):
    def test_a_test_that_hangs_fails_by_its_name(self):
        class Hangs(LimitedTest):
            limit_s = 0.2

            def test_that_waits(self):
                with contextlib.suppress(Exception):
                    __import__("threading").Event().wait()

        class Ends(LimitedTest):
            def test_that_ends(self):
                pass

        printed = io.StringIO()
        suite = unittest.TestSuite([Hangs("test_that_waits"), Ends("test_that_ends")])
        result = unittest.TextTestRunner(printed).run(suite)
        self.assertEqual((result.testsRun, len(result.errors)), (2, 1))
        self.assertRegex(printed.getvalue(), r"test_that_waits takes longer than 0.2 s")


if __name__ == "__main__":
    unittest.main()
