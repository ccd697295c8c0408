"""`isomesh tool`: the descriptions for platforms agree with the command, and work where a platform is installed."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from support import DAEMON, ball

COMMAND = Path(DAEMON).with_name("isomesh")


def described(platform):
    return subprocess.run([COMMAND, "tool", platform], check=True, capture_output=True, text=True).stdout


class Platforms(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = Path(tempfile.mkdtemp(prefix="isomesh-platforms-"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        (cls.folder / "ball.raw").write_bytes(ball().tobytes(order="F"))
        cls.environment = {**os.environ, "PATH": f"{COMMAND.parent}:{os.environ['PATH']}"}

    def run_here(self, *words):
        done = subprocess.run(words, cwd=self.folder, env=self.environment, capture_output=True, text=True, timeout=120)
        return done.returncode, done.stdout + done.stderr

    def needs(self, program):
        if shutil.which(program) is None:
            self.skipTest(f"{program} is not installed, so its description was not run")

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

    def test_a_bids_app(self):
        anat = self.folder / "bids/sub-01/anat"
        anat.mkdir(parents=True)
        import nibabel
        import numpy

        nibabel.save(nibabel.Nifti1Image(ball(), numpy.eye(4)), anat / "sub-01_T1w.nii.gz")
        (self.folder / "app.py").write_text(described("bids"))
        app = (sys.executable, "app.py", "bids", "out", "participant")
        status, told = self.run_here(*app, "--participant-label", "01", "--iso=-9", "--passes", "2")
        self.assertEqual(status, 0, told)
        self.assertEqual((self.folder / "out/sub-01/anat/sub-01_T1w_mesh.glb").read_bytes()[:4], b"glTF")
        self.assertEqual(json.loads((self.folder / "out/dataset_description.json").read_text())["DatasetType"], "derivative")
        status, told = self.run_here(*app, "--participant-label", "02", "--iso=-9")
        self.assertEqual((status, "no image" in told), (1, True))

    def test_snakemake(self):
        self.needs("snakemake")
        (self.folder / "Snakefile").write_text(described("snakemake"))
        config = {"volumes": {"ball": "ball.raw"}, "iso": -9, "dims": "40,32,24", "type": "float32", "close": True}
        (self.folder / "config.json").write_text(json.dumps({**config, "suffix": "stl"}))
        status, told = self.run_here("snakemake", "--cores", "1", "--configfile", "config.json")
        self.assertEqual(status, 0, told)
        self.assertGreater((self.folder / "meshes/ball.stl").stat().st_size, 84)
        status, told = self.run_here("snakemake", "--cores", "1", "-n", "--configfile", "config.json", "--config", "isoo=1")
        self.assertIn("isomesh local has no option isoo", told)

    def test_cwl(self):
        self.needs("cwltool")
        (self.folder / "isomesh.cwl").write_text(described("cwl"))
        status, told = self.run_here("cwltool", "--validate", "isomesh.cwl")
        self.assertEqual(status, 0, told)
        job = {"source": {"class": "File", "path": "ball.raw"}, "iso": "-9", "dims": "40,32,24", "type": "float32"}
        (self.folder / "job.json").write_text(json.dumps({**job, "close": True, "output": "cwl.stl"}))
        status, told = self.run_here("cwltool", "--no-container", "--preserve-entire-environment", "isomesh.cwl", "job.json")
        self.assertEqual(status, 0, told)
        self.assertGreater((self.folder / "cwl.stl").stat().st_size, 84)

    def test_nextflow(self):
        self.needs("nextflow")
        (self.folder / "isomesh.nf").write_text(described("nextflow"))
        words = ("--volumes", "ball.raw", "--iso=-9", "--dims", "40,32,24", "--type", "float32", "--suffix", "stl")
        status, told = self.run_here("nextflow", "run", "isomesh.nf", *words)
        self.assertEqual(status, 0, told)
        self.assertGreater((self.folder / "meshes/ball.stl").stat().st_size, 84)


if __name__ == "__main__":
    unittest.main()
