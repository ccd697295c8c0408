"""Meshes as a notebook shows them, seen by Chromium."""

import html
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import isomesh_client
import numpy
from limits import LimitedTest
from PIL import Image
from test_mesh import tetrahedron

CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium")
LABELS = numpy.array([1, 1, 1, 1, 7, 7, 7, 7], "int32")


def two_labels():
    """Two tetrahedra, red and blue, with vertices of their own."""
    one = tetrahedron()
    vertices = numpy.concatenate([one.vertices, one.vertices + numpy.float32(3)])
    faces = numpy.concatenate([one.faces, one.faces + numpy.uint32(4)])
    colors = numpy.repeat(numpy.array([[255, 0, 0], [0, 0, 255]], "uint8"), 4, 0)
    job = {"mesh": {"labels": [{"label": 1, "name": "</script>left"}, {"label": 7, "name": None}]}}
    return isomesh_client.Mesh(vertices, faces, LABELS, job=job, colors=colors)


def wavy(size):
    """A surface of 2 * size^2 triangles."""
    x, y = numpy.meshgrid(numpy.arange(size + 1), numpy.arange(size + 1), indexing="ij")
    vertices = numpy.stack([x, y, 20 * numpy.sin(x / 40) * numpy.sin(y / 40)], -1).reshape(-1, 3).astype("float32")
    at = (x * (size + 1) + y)[:-1, :-1].reshape(-1)
    faces = numpy.stack([at, at + size + 1, at + size + 2, at, at + size + 2, at + 1], 1).reshape(-1, 3).astype("uint32")
    return isomesh_client.Mesh(vertices, faces)


class Views(LimitedTest):
    def setUp(self):
        self.folder = Path(tempfile.mkdtemp(prefix="isomesh-view-"))
        self.addCleanup(shutil.rmtree, self.folder)

    def chromium(self, *options):
        self.assertTrue(CHROMIUM, "this test needs Debian's package chromium")
        command = [
            CHROMIUM, "--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--no-first-run",
            "--enable-unsafe-swiftshader", "--window-size=400,500", "--virtual-time-budget=10000",
            f"--user-data-dir={self.folder}/profile", "--host-resolver-rules=MAP * ~NOTFOUND", *options,
        ]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    def test_chromium_draws_all_triangles(self):
        page = isomesh_client.view(two_labels()).save(self.folder / "view.html")
        self.assertNotRegex(re.sub(r"<!doctype html>|http://www.w3.org", "", page.read_text()), r"https?://|src=|href=")
        drawn = self.chromium("--dump-dom", page.as_uri())
        self.assertIn('data-drawn="8"', drawn)
        self.assertIn("&lt;/script&gt;left</label>", drawn)
        self.assertIn("label 7</label>", drawn)
        self.assertIn("8 triangles, mm, LPS", drawn)

    def test_a_mesh_shows_itself_in_a_frame(self):
        mesh = two_labels()
        (self.folder / "notebook.html").write_text(f"<!doctype html><div>{mesh._repr_html_()}</div>")
        for _ in range(10):  # a picture may be taken before the frame has been drawn
            self.chromium(f"--screenshot={self.folder}/seen.png", (self.folder / "notebook.html").as_uri())
            pixels = numpy.asarray(Image.open(self.folder / "seen.png").convert("RGB")).astype(int)
            red, blue = ((pixels[..., a] > 60 + pixels[..., b]).sum() for a, b in ((0, 2), (2, 0)))
            if red > 1000 and blue > 1000:
                return
        self.fail(f"{red} red pixels and {blue} blue ones")

    def test_labels_are_chosen(self):
        mesh = two_labels()
        text = html.unescape(isomesh_client.view(mesh, [7], height=99)._repr_html_())
        self.assertIn('"count": 4, ', text.replace("}", ", "))
        self.assertIn("label 7", text)
        self.assertNotIn("script>left", text)
        self.assertIn("height: 99px", text)
        with self.assertRaisesRegex(ValueError, "the mesh has no label 3, 4"):
            isomesh_client.view(mesh, [3, 4, 7])
        with self.assertRaisesRegex(ValueError, "no labels to choose from"):
            isomesh_client.view(tetrahedron(), [1])
        self.assertRegex(repr(isomesh_client.view(mesh)), r"^<View of 0\.0 MB; ")

    def test_a_large_mesh_is_shown_coarser(self):
        mesh = wavy(150)
        before = mesh.faces.copy()
        text = isomesh_client.view(mesh, triangles=2000)._page
        shown = int(re.search(r"shown with ([\d\\u f]+)", text)[1].replace("\\u202f", ""))
        self.assertGreater(shown, 500)
        self.assertLessEqual(shown, 2000)
        self.assertTrue((mesh.faces == before).all())

    def test_nothing_to_show(self):
        self.assertIsNone(isomesh_client.Mesh(numpy.zeros((0, 3), "f4"), numpy.zeros((0, 3), "u4"))._repr_html_())


# The signatures of other packages, as far as they concern this one. Debian 12 has none of these.
class Meshio:
    def __init__(self, points, cells, cell_data):
        self.given = {"points": points, "cells": cells, "cell_data": cell_data}


class OtherPackages(LimitedTest):
    def test_to_meshio(self):
        module = type(sys)("meshio")
        module.Mesh = Meshio
        mesh = two_labels()
        with mock.patch.dict(sys.modules, {"meshio": module}):
            given = mesh.to_meshio().given
            self.assertEqual(tetrahedron().to_meshio().given["cell_data"], {})
        self.assertEqual(given["points"].tolist(), mesh.vertices.tolist())
        self.assertEqual((given["cells"][0][0], given["cells"][0][1].tolist()), ("triangle", mesh.faces.tolist()))
        self.assertEqual([each.tolist() for each in given["cell_data"]["label"]], [LABELS.tolist()])

    def test_to_pyvista(self):
        module = type(sys)("pyvista")
        module.wrap = lambda surface: ("wrapped", surface.GetNumberOfCells())
        with mock.patch.dict(sys.modules, {"pyvista": module}):
            self.assertEqual(two_labels().to_pyvista(), ("wrapped", 8))

    def test_a_missing_package_is_named(self):
        for name in ("meshio", "pyvista"):
            with mock.patch.dict(sys.modules, {name: None}), self.assertRaisesRegex(ImportError, f"pip install {name}"):
                getattr(tetrahedron(), f"to_{name}")()


if __name__ == "__main__":
    unittest.main()
