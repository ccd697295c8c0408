"""The package as users get it: installed, typed, and as its README says."""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import isomesh
from support import ROOT, DaemonTest

PACKAGE = ROOT / "client" / "python"
HEAD = Path("/usr/share/mricron/templates/ch2.nii.gz")


class Readme(DaemonTest):
    def test_its_examples_run(self):
        text = (PACKAGE / "README.md").read_text()
        code = "\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL))
        self.assertGreater(code.count("client."), 8)
        shutil.copy(HEAD, self.folder / "head.nii.gz")
        code = code.replace("http://127.0.0.1:8080", self.url)
        checks = """
assert abs(mesh.vertices).max() < 60 and (same.faces == client.mesh("head.nii.gz", iso=60).faces).all()
assert len(left) > 100 and len(bone.faces) > 1000
"""
        output = subprocess.check_output([sys.executable, "-c", code + checks], cwd=self.folder, text=True)
        self.assertIn("<Mesh of 5091320 triangles and 2544488 vertices, mm, LPS>", output)
        self.assertEqual((self.folder / "head.stl").stat().st_size % 50, 34)


class Package(unittest.TestCase):
    def test_pip_installs_it(self):
        with tempfile.TemporaryDirectory() as folder:
            # The build leaves traces beside its sources.
            source = Path(folder, "source")
            shutil.copytree(PACKAGE, source, ignore=shutil.ignore_patterns("build", "*.egg-info", "__pycache__"))
            subprocess.check_call(
                [sys.executable, "-m", "pip", "install", "--quiet", "--no-build-isolation", "--no-deps",
                 "--no-index", "--target", Path(folder, "to"), source],
                env={**os.environ, "PIP_ROOT_USER_ACTION": "ignore", "PIP_DISABLE_PIP_VERSION_CHECK": "1"},
            )
            installed = sorted(each.name for each in Path(folder, "to", "isomesh").iterdir() if each.is_file())
            sources = sorted(each.name for each in (PACKAGE / "src" / "isomesh").iterdir() if each.is_file())
            self.assertEqual(installed, sources)
            self.assertIn("py.typed", installed)
            script = "import isomesh, sys; print(isomesh.__version__, 'numpy' in sys.modules, isomesh.__file__)"
            environment = {**os.environ, "PYTHONPATH": str(Path(folder, "to"))}
            printed = subprocess.check_output([sys.executable, "-c", script], text=True, env=environment)
            self.assertEqual(printed.split()[:2], [isomesh.__version__, "False"])
            self.assertTrue(printed.split()[2].startswith(folder))

    def test_its_version_is_the_projects(self):
        project = (ROOT / "CMakeLists.txt").read_text()
        self.assertIn(f"project(isomesh VERSION {isomesh.__version__} ", project)

    def test_its_types_are_those_of_the_api(self):
        subprocess.check_call([sys.executable, PACKAGE / "generate", "--check"])

    def test_types_hold(self):
        mypy = [sys.executable, "-m", "mypy", "--config-file", PACKAGE / "pyproject.toml", "--no-error-summary"]
        with tempfile.TemporaryDirectory() as folder:
            cache = ["--cache-dir", folder]
            subprocess.check_call([*mypy, *cache, PACKAGE / "src" / "isomesh"])
            use = Path(folder, "use.py")
            use.write_text("import isomesh\nisomesh.Client().mesh('x', iso=1, passez=3)\n")
            environment = {**os.environ, "MYPYPATH": str(PACKAGE / "src")}
            found = subprocess.run([*mypy, *cache, use], env=environment, capture_output=True, text=True)
            self.assertIn('Unexpected keyword argument "passez"', found.stdout)


if __name__ == "__main__":
    unittest.main()
