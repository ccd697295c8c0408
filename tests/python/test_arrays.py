"""Uploads of arrays and images, and meshes as arrays."""

import json
import subprocess
import sys
import unittest
import warnings

import isomesh_client
import nibabel
import numpy
from support import DaemonTest, ball, turned


class Arrays(DaemonTest):
    def test_a_ball_lies_where_its_affine_says(self):
        size, radius = (40, 32, 24), 6.0
        spacing = (0.5, 0.75, 1.25)
        affine = turned(spacing)
        mesh = self.client.mesh(ball(size, spacing=spacing), affine=affine, iso=-radius, passes=0)
        middle = (affine @ [*((n - 1) / 2 for n in size), 1])[:3]
        distances = numpy.linalg.norm(mesh.in_space("ras").vertices - middle, axis=1)
        self.assertLess(abs(distances - radius).max(), 0.1)
        self.assertGreater(abs(mesh.vertices - middle).max(), 20, "LPS and RAS are the same here")

    def test_space_lps_takes_the_affine_as_it_is(self):
        samples, affine = ball(), turned()
        as_ras = self.client.upload(samples, affine=numpy.diag([-1.0, -1.0, 1.0, 1.0]) @ affine)
        as_lps = self.client.upload(samples, affine=affine, affine_space="lps")
        self.assertEqual(as_ras["id"], as_lps["id"])

    def test_faces_are_turned_outward(self):
        mesh = self.client.mesh(ball(), iso=-8, passes=0)
        corners = mesh.vertices[mesh.faces].astype("float64")
        volume = numpy.einsum("ij,ij->i", corners[:, 0], numpy.cross(corners[:, 1], corners[:, 2])).sum() / 6
        self.assertAlmostEqual(volume / (4 / 3 * numpy.pi * 8**3), 1, delta=0.02)
        self.assertAlmostEqual(volume, mesh.job["mesh"]["volume_mm3"]["extracted"], delta=0.01)

    def test_an_image_is_the_same_volume_as_its_file(self):
        file = self.folder / "ball.nii.gz"
        nibabel.save(nibabel.Nifti1Image(ball(), turned()), file)
        of_file = self.client.upload(file)
        self.assertEqual(self.client.upload(nibabel.load(file))["id"], of_file["id"])
        self.assertEqual(of_file["name"], "ball.nii.gz")

    def test_an_image_has_the_size_of_its_file_in_any_unit(self):
        for unit, scale in (("unknown", 1), ("mm", 1), ("meter", 1000), ("micron", 0.001)):
            with self.subTest(unit):
                image = nibabel.Nifti1Image(ball(), turned() @ numpy.diag([2.0, 4.0, 8.0, 1.0]))
                image.header.set_xyzt_units(unit)
                nibabel.save(image, self.folder / "unit.nii")
                of_file, of_image = self.client.upload(self.folder / "unit.nii"), self.client.upload(image)
                steps = numpy.linalg.norm(image.affine[:3, :3], axis=0)
                numpy.testing.assert_allclose(of_image["spacing"], steps * scale, rtol=1e-6)
                for member in ("spacing", "origin", "direction"):
                    numpy.testing.assert_allclose(of_image[member], of_file[member], rtol=1e-6, atol=1e-9)
        in_mm = self.client.upload(image, affine=image.affine)
        numpy.testing.assert_allclose(in_mm["spacing"], steps, err_msg="an affine of the caller is in millimetres")

    def test_an_image_in_an_unknown_unit_is_refused(self):
        image = nibabel.Nifti1Image(ball(), turned())
        image.header["xyzt_units"] = 5
        with self.assertRaisesRegex(ValueError, "spatial unit 5 of the image's header is unknown"):
            self.client.upload(image)

    def test_forms_of_an_image_that_differ_give_a_warning(self):
        image = nibabel.Nifti1Image(ball(), turned())
        image.set_qform(turned(), code=1)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            self.client.upload(image)
        other = turned()
        other[0, 3] += 5000
        image.set_qform(other, code=1)
        image.header.set_xyzt_units("micron")
        with self.assertWarnsRegex(isomesh_client.VolumeWarning, r"up to 5\.0 mm apart.*\(forms-differ\)$") as warned:
            volume = self.client.upload(image)
        self.assertEqual(warned.filename, __file__)
        # Both axes run to the right and front, so the volume begins at their ends.
        corner = turned() @ (*(size - 1 for size in ball().shape[:2]), 0, 1)
        self.assertAlmostEqual(volume["origin"][0], -corner[0] / 1000, places=6)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            self.client.upload(image, affine=image.get_qform() / 1000)

    def test_a_spacing_may_be_an_array(self):
        spacing = numpy.array([0.5, 0.75, 1.25])
        volume = self.client.upload(ball(), spacing=spacing)
        self.assertEqual(volume["spacing"], spacing.tolist())
        self.assertEqual(volume["id"], self.client.upload(ball(), affine=numpy.diag([-0.5, -0.75, 1.25, 1]))["id"])
        self.assertEqual(self.client.upload(ball())["spacing"], [1, 1, 1], "without one, as raw samples")
        with self.assertRaisesRegex(ValueError, "spacing"):
            self.client.mesh(ball(), spacing=[], iso=-8)

    def test_samples_keep_their_type_and_values(self):
        for name in ("uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64"):
            with self.subTest(name):
                samples = numpy.zeros((3, 4, 5), name)
                samples[2, 0, 4] = 100
                for order in ("<", ">"):
                    volume = self.client.upload(samples.astype(samples.dtype.newbyteorder(order)))
                    self.assertEqual(volume["type"], name)
                    self.assertEqual(volume["dims"], [3, 4, 5])
                    self.assertEqual(volume["range"], [0, 100])

    def test_other_types_are_sent_as_one_that_holds_them(self):
        for name, sent in (("bool", "uint8"), ("float16", "float32"), ("int64", "int32"), ("uint64", "int32")):
            samples = numpy.zeros((3, 3, 3), name)
            samples[1, 1, 1] = 1
            self.assertEqual(self.client.upload(samples)["type"], sent, name)
        large = numpy.full((2, 2, 2), 2**32 - 1, "uint64")
        large[0, 0, 0] = 0
        self.assertEqual(self.client.upload(large)["range"], [0, 2**32 - 1])

    def test_a_mask_that_hides_nothing_is_no_obstacle(self):
        bare = numpy.ma.masked_array(ball(), mask=False)
        self.assertEqual(self.client.upload(bare)["id"], self.client.upload(ball())["id"])

    def test_what_cannot_be_sent_is_refused_with_the_reason(self):
        wrong = [
            (numpy.full((2, 2, 2), 2**40), {}, ValueError, "do not fit"),
            (numpy.zeros((2, 2, 2), complex), {}, TypeError, "complex"),
            (numpy.zeros((2, 2)), {}, ValueError, "three axes"),
            (numpy.zeros((2, 2, 2, 2)), {}, ValueError, "three axes"),
            (ball(), {"affine": numpy.eye(3)}, ValueError, "4 x 4"),
            (ball(), {"affine": numpy.diag([1.0, 0, 1, 1])}, ValueError, "length zero"),
            (ball(), {"affine": numpy.eye(4), "affine_space": "mni"}, ValueError, "'ras' or 'lps'"),
            (ball(), {"affine": numpy.eye(4) * numpy.nan}, ValueError, "finite"),
            (ball(), {"affine": numpy.eye(4), "spacing": (1, 1, 1)}, ValueError, "either"),
            (numpy.ma.masked_less(ball(), -10), {}, ValueError, "filled"),
            (object(), {}, TypeError, "object"),
            ("/no/such/file.nii", {}, FileNotFoundError, "/no/such/file.nii"),
            (ball(), {"spacing": (-1, 1, 1)}, ValueError, "spacing must be three positive"),
            (ball(), {"spacing": (1, 1, 1, 9)}, ValueError, "spacing"),
            (ball(), {"spacing": (1, 1)}, ValueError, "spacing"),
            (ball(), {"spacing": []}, ValueError, "spacing"),
            (ball(), {"spacing": "123"}, ValueError, "spacing"),
            (ball(), {"spacing": 1}, TypeError, "spacing"),
            (ball(), {"spacing": (1, 2, float("inf"))}, ValueError, "spacing"),
            (b"", {"spacing": "123"}, ValueError, "spacing"),
            (b"", {"raw": isomesh_client.Raw((1, 1, 1), "uint8", spacing=(1, 1))}, ValueError, "spacing"),
            ("", {}, FileNotFoundError, "empty"),
            ([""], {}, FileNotFoundError, "empty"),
            (b"", {"affine": numpy.eye(4)}, ValueError, "for arrays"),
        ]
        for source, more, kind, text in wrong:
            with self.subTest(text), self.assertRaisesRegex(kind, text):
                self.client.upload(source, **more)

    def test_labels_come_with_their_faces(self):
        samples = numpy.zeros((12, 12, 12), "int64")
        samples[2:6, 2:10, 2:10], samples[6:10, 2:10, 2:10] = 3, 7
        mesh = self.client.mesh(samples, labels="all", label_names={3: "left", 7: "right"})
        self.assertEqual(set(mesh.labels.tolist()), {3, 7})
        self.assertEqual(len(mesh.labels), len(mesh.faces))
        self.assertEqual([each["name"] for each in mesh.job["mesh"]["labels"]], ["left", "right"])
        left, right = numpy.unique(samples[samples > 0])  # numpy's numbers
        mesh = self.client.mesh(
            samples, labels="all", label_names={left: "one", right: "two"}, label_colors={str(left): "#ff0000"}
        )
        self.assertEqual([each["name"] for each in mesh.job["mesh"]["labels"]], ["one", "two"])
        self.assertEqual(mesh.job["mesh"]["labels"][0]["color"], "#ff0000")
        with self.assertRaisesRegex(TypeError, "integer"):
            self.client.mesh(samples, labels="all", label_names={1.5: "x"})
        middle = mesh.vertices[mesh.faces[mesh.labels == 3]].mean()
        self.assertLess(middle, mesh.vertices[mesh.faces[mesh.labels == 7]].mean())

    def test_labels_beyond_31_bits_keep_their_value(self):
        samples = numpy.zeros((4, 4, 4), "uint32")
        samples[1:3, 1:3, 1:3] = 4294967295
        self.assertEqual(set(self.client.mesh(samples, labels="all").labels.tolist()), {4294967295})

    def test_an_empty_surface_is_an_empty_mesh(self):
        range_of = r"the iso-value 5 is outside the samples' range, -\d+\.?\d* to -0\.8"
        with self.assertWarnsRegex(isomesh_client.VolumeWarning, "the surface is empty: " + range_of):
            mesh = self.client.mesh(ball(), iso=5)
        with self.assertWarnsRegex(isomesh_client.VolumeWarning, "the surface is empty: no connected component was kept"):
            self.client.mesh(ball(), iso=-8, components={"min_triangles": 10**8})
        self.assertEqual(mesh.vertices.shape, (0, 3))
        self.assertEqual(mesh.in_space("ras").faces.shape, (0, 3))

    def test_without_numpy_a_mesh_has_the_same_numbers(self):
        mesh = self.client.mesh(ball(), iso=-8)
        path = self.client.download(mesh.job, self.folder / "ball.ply")
        script = """
import sys
sys.modules["numpy"] = None
import isomesh_client, json
mesh = isomesh_client.read_ply(sys.argv[1])
ras = mesh.in_space("ras")
empty = isomesh_client.Client(sys.argv[2]).mesh(sys.argv[3], iso=1000)
bounds = [mesh.bounds.tolist(), empty.bounds.tolist()]
mesh.save(sys.argv[4])
try:
    mesh.normals
except ImportError as error:
    print(error, file=sys.stderr)
print(json.dumps([mesh.vertices.tolist(), ras.vertices.tolist(), mesh.faces.tolist(), len(empty.faces), bounds]))
"""
        volume = self.folder / "volume.nii"
        nibabel.save(nibabel.Nifti1Image(ball(), numpy.eye(4)), volume)
        saved = self.folder / "saved.ply"
        command = [sys.executable, "-W", "ignore", "-c", script, path, self.url, volume, saved]
        found = subprocess.run(command, check=True, capture_output=True, text=True)
        vertices, ras, faces, empty, bounds = json.loads(found.stdout)
        self.assertTrue(numpy.array_equal(numpy.array(vertices, "float32"), mesh.vertices))
        self.assertTrue(numpy.array_equal(numpy.array(ras, "float32"), mesh.in_space("ras").vertices))
        self.assertTrue(numpy.array_equal(faces, mesh.faces))
        self.assertEqual(empty, 0)
        self.assertEqual(bounds, [mesh.bounds.tolist(), [[0, 0, 0], [0, 0, 0]]])
        self.assertEqual(saved.read_bytes(), path.read_bytes())
        self.assertIn("mesh.normals needs the package numpy", found.stderr)

    def test_a_damaged_ply_is_refused(self):
        path = self.client.download(self.client.mesh(ball(), iso=-8).job, self.folder / "whole.ply")
        whole = path.read_bytes()
        self.assertGreater(len(isomesh_client.read_ply(whole).faces), 100)
        begin = whole.index(b"end_header\n") + 11
        for damaged in (
            whole[:-1],
            whole + b"\0",
            b"",
            whole[:40],
            whole.replace(b"binary_little", b"binary_big", 1),
            whole.replace(b"float x", b"float u", 1),
            whole[:-13] + b"\4" + whole[-12:],
            whole[:begin],
        ):
            with self.assertRaises(isomesh_client.WrongAnswer):
                isomesh_client.read_ply(damaged)


if __name__ == "__main__":
    unittest.main()
