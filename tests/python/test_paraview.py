"""The plugin for ParaView, in ParaView's own pvpython where that is installed, or where PVPYTHON names it."""

import json
import os
import shutil
import subprocess
import unittest

import numpy
from support import ROOT, DaemonTest, ball
from test_slicer import nrrd

PVPYTHON = os.environ.get("PVPYTHON") or shutil.which("pvpython")


@unittest.skipUnless(PVPYTHON, "pvpython of ParaView is not installed, and python3-paraview excludes python3-vtk9")
class ParaView(DaemonTest):
    def test_reader_and_filter(self):
        samples = ball()
        volume, labels = self.folder / "ball.nrrd", self.folder / "labels.nrrd"
        volume.write_bytes(nrrd(samples, "float"))
        numpy.save(f"{volume}.npy", samples)
        segments = numpy.zeros((24, 24, 24), "uint8")
        segments[4:12, 4:20, 4:20], segments[12:20, 4:20, 4:20] = 1, 2
        labels.write_bytes(nrrd(segments, "uint8"))
        script = ROOT / "tests/python/in_paraview.py"
        plugin = ROOT / "client/paraview/isomesh_paraview.py"
        ran = subprocess.run(
            [PVPYTHON, script, plugin, self.url, volume, labels], check=False, capture_output=True, text=True, timeout=100
        )
        self.assertEqual(ran.returncode, 0, ran.stderr)
        seen = json.loads(ran.stdout.splitlines()[-1])

        mesh = self.client.mesh(volume, iso=-9)
        self.assertEqual(self.counts(seen["reader"]), (len(mesh.vertices), len(mesh.faces), []))
        numpy.testing.assert_allclose(seen["reader"]["bounds"], mesh.bounds.T.ravel())

        simple = self.client.mesh(volume, iso=-9, max_error_mm=0.2)
        self.assertEqual(self.counts(seen["simplified"]), (len(simple.vertices), len(simple.faces), ["distance_mm"]))
        count, _, most = seen["simplified"]["arrays"]["distance_mm"]
        self.assertEqual(count, len(simple.vertices))
        self.assertTrue(0 < most <= 0.2, most)

        # A volume that is stored is not sent again, unless the daemon has removed it.
        self.assertEqual((seen["uploads"], seen["all uploads"]), (1, 2))
        self.assertEqual(self.counts(seen["uploaded again"]), (len(simple.vertices), len(simple.faces), []))

        both = self.client.mesh(labels, labels="all")
        self.assertEqual(self.counts(seen["labels"]), (len(both.vertices), len(both.faces), ["distance_mm", "label"]))
        self.assertEqual(seen["labels"]["arrays"]["label"], [len(both.faces), 1, 2])
        self.assertEqual(seen["one label"]["arrays"]["label"][1:], [2, 2])

        self.assertEqual(seen["allowed"]["cells"], 0)
        self.assertEqual(ran.stderr.count("the surface is empty"), 1, ran.stderr)
        wrong = (("no server", "127.0.0.1:9"), ("wrong labels", 'labels: must be "all"'), ("empty", "the iso-value 5 separates none"))
        for name, reason in wrong:
            self.assertEqual(seen[name]["cells"], 0, name)
            self.assertIn(reason, ran.stderr)

        # Of two arrays it takes the one that was chosen; its surface lies where the image does, turned and moved.
        turn = numpy.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]) * (0.5, 0.75, 1.25)
        affine = numpy.eye(4)
        affine[:3, :3], affine[:3, 3] = turn, turn @ (3, -2, 0) + (100, -200, 300)
        there = self.client.mesh(samples, affine=affine, affine_space="lps", iso=-9)
        self.assertEqual(self.counts(seen["filter"]), (len(there.vertices), len(there.faces), []))
        numpy.testing.assert_allclose(seen["filter"]["bounds"], there.bounds.T.ravel())

    @staticmethod
    def counts(surface):
        return surface["points"], surface["cells"], sorted(surface["arrays"])
