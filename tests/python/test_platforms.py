"""`isomesh tool`: the descriptions for platforms agree with the command, and work on the platforms that Debian has."""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from support import DAEMON, ball

COMMAND = Path(DAEMON).with_name("isomesh")
BALL = {"dims": "40,32,24", "type": "float32", "iso": "-9"}
LABELS = {"dims": "40,32,24", "type": "uint8", "labels": "all"}


def described(platform, *options):
    return subprocess.run([COMMAND, "tool", platform, *options], check=True, capture_output=True, text=True).stdout


def words_of(options):
    return [f"--{name}={value}" for name, value in options.items()]


class Platforms(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = Path(tempfile.mkdtemp(prefix="isomesh-platforms-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        (cls.folder / "ball.raw").write_bytes(ball().tobytes(order="F"))
        (cls.folder / "labels.raw").write_bytes((ball() > -9).astype("uint8").tobytes(order="F"))
        cls.environment = {**os.environ, "PATH": f"{COMMAND.parent}:{os.environ['PATH']}"}

    def run_here(self, *words):
        done = subprocess.run(words, cwd=self.folder, env=self.environment, capture_output=True, text=True, timeout=120)
        return done.returncode, done.stdout + done.stderr

    def test_every_option_of_the_command_is_described(self):
        text = subprocess.run([COMMAND, "local", "--help"], check=True, capture_output=True, text=True).stdout
        cwl = json.loads(described("cwl"))
        for name in ("iso", "labels", "max-error", "close", "masks", "member", "dims", "lambda"):
            self.assertIn(f"  --{name}", text)
            key = cwl["inputs"][name.replace("-", "_")]
            self.assertEqual(key["inputBinding"], {"prefix": f"--{name}"})
        self.assertEqual(cwl["inputs"]["close"]["type"], "boolean?")
        self.assertEqual(cwl["inputs"]["iso"]["type"], "string?")
        self.assertEqual(cwl["inputs"]["label_name"]["type"][1]["inputBinding"], {"prefix": "--label-name"})
        for name in cwl["inputs"]:
            if name not in ("source", "output"):
                self.assertIn(f"--{name.replace('_', '-')}", text)
        self.assertFalse({"jobs", "daemon", "dry_run", "callback", "help"} & set(cwl["inputs"]))
        xnat = json.loads(described("xnat"))
        self.assertEqual({each["name"].replace("-", "_") for each in xnat["inputs"]} | {"source"}, set(cwl["inputs"]))
        for each in xnat["inputs"]:
            self.assertEqual(xnat["command-line"].count(each["replacement-key"]), 1, each["name"])
        for platform in ("snakemake", "nextflow", "bids"):
            for name in cwl["inputs"]:
                if name not in ("source", "output"):
                    self.assertIn(f"'{name}'", described(platform))

    def test_a_program_in_the_working_folder_is_not_the_daemon(self):
        place = self.folder / "alone"
        place.mkdir()
        shutil.copy(COMMAND, place / "isomesh")
        (self.folder / "isomeshd").write_text("#!/bin/sh\ntouch ran\n")
        (self.folder / "isomeshd").chmod(0o700)
        words = [place / "isomesh", "local", "ball.raw", "--iso", "1", "-o", "ball.stl"]
        for path in ("", ":", "/nonexistent:"):
            done = subprocess.run(words, cwd=self.folder, env={"PATH": path}, capture_output=True, text=True)
            self.assertIn("the program isomeshd was not found", done.stderr)
        self.assertFalse((self.folder / "ran").exists())

    def test_the_image_is_a_name_and_no_program(self):
        for image in ("", "a b", "x'\nimport os", 'x"}', "@FLAGS@", "-x", "a;b", "$(touch x)"):
            for platform in ("cwl", "snakemake", "nextflow", "bids", "xnat"):
                done = subprocess.run([COMMAND, "tool", platform, "--image", image], capture_output=True, text=True)
                self.assertEqual((done.returncode, done.stdout), (2, ""), image)
        image = "registry.example:5000/group/isomesh_1:0.1@sha256:0a"
        done = subprocess.run([COMMAND, "tool", "bids", "--image", image], check=True, capture_output=True, text=True)
        self.assertIn(image, done.stdout)

    def test_a_bids_app(self):
        import nibabel
        import numpy

        for subject in ("01", "02"):
            anat = self.folder / f"bids/sub-{subject}/anat"
            anat.mkdir(parents=True)
            nibabel.save(nibabel.Nifti1Image(ball(), numpy.eye(4)), anat / f"sub-{subject}_T1w.nii.gz")
        (self.folder / "app.py").write_text(described("bids"))
        app = (sys.executable, "app.py", "bids", "out", "participant")
        # The box is that of the whole volume in LPS, and begins with a minus.
        words = ("--participant-label", "sub-01", "--iso", "-9", "--crop", "-39,-31,0,0,0,23", "--passes", "2")
        status, told = self.run_here(*app, *words)
        self.assertEqual(status, 0, told)
        self.assertEqual((self.folder / "out/sub-01/anat/sub-01_T1w_mesh.glb").read_bytes()[:4], b"glTF")
        self.assertFalse((self.folder / "out/sub-02").exists())
        description = self.folder / "out/dataset_description.json"
        self.assertEqual(json.loads(description.read_text())["DatasetType"], "derivative")
        description.write_text("{}")
        self.assertEqual(self.run_here(*app, "--iso=-9", "--suffix", "stl")[0], 0)
        self.assertEqual(len([*self.folder.glob("out/sub-*/anat/*_mesh.stl")]), 2)
        self.assertEqual(description.read_text(), "{}")
        status, told = self.run_here(*app, "--participant-label", "01", "03", "--iso=-9")
        self.assertEqual((status, "no subject 03" in told), (1, True))
        status, told = self.run_here(*app, "--image", "T2w", "--iso=-9")
        self.assertEqual((status, "no image" in told), (1, True))
        nibabel.save(nibabel.Nifti1Image(ball(), numpy.eye(4)), anat / "sub-02_T1w.nii")
        status, told = self.run_here(*app, "--iso=-9", "--suffix", "ply")
        self.assertEqual((status, "would both become" in told), (1, True))
        self.assertEqual([*self.folder.glob("out/sub-*/anat/*.ply")], [])

    def snakemake(self, config, *words):
        (self.folder / "config.json").write_text(json.dumps(config))
        return self.run_here("snakemake", "--cores", "1", "--configfile", "config.json", *words)

    def test_snakemake(self):
        (self.folder / "Snakefile").write_text(described("snakemake"))
        volumes = {"ball.T1": "ball.raw", "ball.T2": "ball.raw"}
        status, told = self.snakemake({**BALL, "volumes": volumes, "close": True, "merge": False, "suffix": "stl"})
        self.assertEqual(status, 0, told)
        for name in volumes:
            self.assertGreater((self.folder / f"meshes/{name}.stl").stat().st_size, 84)
        status, told = self.snakemake({**BALL, "volumes": volumes}, "-n", "--config", "isoo=1")
        self.assertIn("isomesh local has no option isoo", told)
        status, told = self.snakemake({**BALL, "volumes": volumes}, "-n", "--config", "close=yes")
        self.assertIn("close is true or false, not yes", told)

    def cwl(self, source, **values):
        (self.folder / "job.json").write_text(json.dumps({"source": {"class": "File", "path": source}, **values}))
        status, told = self.run_here("cwltool", "--no-container", "--preserve-entire-environment", "isomesh.cwl", "job.json")
        self.assertEqual(status, 0, told)

    def test_cwl(self):
        (self.folder / "isomesh.cwl").write_text(described("cwl"))
        status, told = self.run_here("cwltool", "--validate", "isomesh.cwl")
        self.assertEqual(status, 0, told)
        self.cwl("ball.raw", **BALL, close=True, crop="-1,0,0,39,31,23", output="cwl.stl")
        self.assertGreater((self.folder / "cwl.stl").stat().st_size, 84)
        self.cwl("labels.raw", **LABELS, label_name=["1=skull bone"], output="cwl labels.obj")
        self.assert_has_its_materials(self.folder / "cwl labels.obj")

    def assert_has_its_materials(self, mesh):
        name = re.search("^mtllib (.*)$", mesh.read_text(), re.MULTILINE).group(1)
        self.assertIn("newmtl", (mesh.parent / name).read_text())

    def nextflow(self, volumes, *words):
        """Runs under a stand-in, unless Nextflow is there."""
        stub = ("groovy", Path(__file__).with_name("nextflow.groovy"), "isomesh.nf")
        platform = ("nextflow", "run", "isomesh.nf") if shutil.which("nextflow") else stub
        shutil.rmtree(self.folder / "work", ignore_errors=True)
        return self.run_here(*platform, "--volumes", volumes, *words)

    def test_nextflow(self):
        (self.folder / "isomesh.nf").write_text(described("nextflow", "--image", "registry.example/group/its:1"))
        scans = self.folder / "scans"
        for name in ("01.T1.raw", "01.T2.raw", "two words.raw"):
            (scans / name).parent.mkdir(exist_ok=True)
            shutil.copy(self.folder / "ball.raw", scans / name)
        status, told = self.nextflow("scans/*.raw", *words_of(BALL), "--suffix", "stl", "--max-error", "0.5", "--close", "--outdir", "surfaces")
        self.assertEqual(status, 0, told)
        meshes = {path.name: path.stat().st_size for path in (self.folder / "surfaces").glob("*.stl")}
        self.assertEqual(set(meshes), {"01.T1.stl", "01.T2.stl", "two words.stl"})
        # The error was obeyed: without it there are thousands of triangles.
        self.assertLess(max(meshes.values()), 84 + 50 * 1000)
        status, told = self.nextflow("labels.raw", *words_of(LABELS), "--suffix", "obj")
        self.assertEqual(status, 0, told)
        self.assert_has_its_materials(self.folder / "meshes/labels.obj")

    def test_nextflow_refuses_what_would_be_lost(self):
        (self.folder / "isomesh.nf").write_text(described("nextflow"))
        scans = self.folder / "same"
        for name in ("a.raw", "a.raw.gz"):
            (scans / name).parent.mkdir(exist_ok=True)
            shutil.copy(self.folder / "ball.raw", scans / name)
        for volumes, word, reason in (
            ("same/*", "--close", "would both become a.glb"),
            ("same/*.nii", "--close", "match"),
            ("ball.raw", "--isoo=3", "isomesh local has no option --isoo"),
            ("ball.raw", "--close=yes", "--close is true or false, not yes"),
        ):
            status, told = self.nextflow(volumes, *words_of(BALL), word)
            self.assertNotEqual(status, 0)
            self.assertIn(reason, told)


if __name__ == "__main__":
    unittest.main()
