"""The package as users get it: installed, typed, and as its README says."""

import importlib.machinery
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
import typing
import unittest
from pathlib import Path

import isomesh_client
from limits import LimitedTest
from support import ROOT, DaemonTest
from test_mesh import TRIMESH

PACKAGE = ROOT / "client" / "python"
HEAD = Path("/usr/share/mricron/templates/ch2.nii.gz")
# The least that `generate` needs beside a schema under test.
BARE = "JobParameters: {properties: {}}, Job: {properties: {state: {}, started: {}, finished: {}, mesh: {}}}"
README = (PACKAGE / "README.md").read_text()


def examples(language):
    return "\n".join(re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL))


class Readme(DaemonTest):
    limit_s = 300

    def test_every_example_is_of_a_known_language(self):
        self.assertEqual(set(re.findall(r"```(\w+)", README)), {"python", "sh"})
        rest = re.sub(r"```.*?```", "", README, flags=re.DOTALL)
        self.assertIsNone(re.search(r"^ {4}\S|```", rest, re.MULTILINE), "an example that no test runs")

    def test_its_examples_run(self):
        code = examples("python")
        self.assertGreater(code.count("client."), 8)
        shutil.copy(HEAD, self.folder / "head.nii.gz")
        (self.folder / "trimesh.py").write_text(TRIMESH)
        code = code.replace("http://127.0.0.1:8080", self.url)
        checks = """
assert abs(mesh.vertices).max() < 60 and (same.faces == client.mesh("head.nii.gz", iso=60).faces).all()
assert len(left) > 100 and len(bone.faces) > 1000 and (bone.labels == 1).all()
assert surface.GetNumberOfCells() == len(solid.given["faces"]) == len(mesh.faces)
"""
        output = subprocess.check_output([sys.executable, "-c", code + checks], cwd=self.folder, text=True)
        self.assertIn("<Mesh of 1627070 triangles and 814234 vertices, mm, LPS>", output)
        self.assertEqual((self.folder / "head.stl").stat().st_size % 50, 34)
        self.assertEqual((self.folder / "head.glb").read_bytes()[:4], b"glTF")

    def test_its_lines_for_a_shell_install_the_package(self):
        """As pasted, into a copy of the project. Packages of Debian stand in for those of PyPI."""
        root = self.folder / "project"
        shutil.copytree(PACKAGE, root / "client" / "python", ignore=shutil.ignore_patterns("build", "*.egg-info"))
        script = "set -e\n" + examples("sh") + "\npython3 -c 'import isomesh_client; print(isomesh_client.__file__)'\n"
        environment = {
            **os.environ, "PATH": "/usr/bin:/bin", "PYTHONPATH": "/usr/lib/python3/dist-packages",
            "PIP_NO_INDEX": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1",
        }
        found = subprocess.run(["sh", "-c", script], cwd=root, env=environment, capture_output=True, text=True)
        self.assertEqual(found.returncode, 0, found.stdout + found.stderr)
        self.assertIn(f"{root}/isomesh-env/lib/", found.stdout.splitlines()[-1])


class Package(LimitedTest):
    @classmethod
    def setUpClass(cls):
        cls.cache = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.cache.cleanup)

    def test_pip_installs_it_without_a_network(self):
        with tempfile.TemporaryDirectory() as folder:
            subprocess.check_call(
                [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--target", Path(folder, "to"), PACKAGE],
                env={**os.environ, "PIP_ROOT_USER_ACTION": "ignore", "PIP_DISABLE_PIP_VERSION_CHECK": "1"},
            )
            installed = sorted(each.name for each in Path(folder, "to", "isomesh_client").iterdir() if each.is_file())
            sources = sorted(each.name for each in (PACKAGE / "src" / "isomesh_client").iterdir() if each.is_file())
            self.assertEqual(installed, sources)
            self.assertIn("py.typed", installed)
            script = "import isomesh_client, sys; print(isomesh_client.__version__, 'numpy' in sys.modules, isomesh_client.__file__)"
            environment = {**os.environ, "PYTHONPATH": str(Path(folder, "to"))}
            printed = subprocess.check_output([sys.executable, "-c", script], text=True, env=environment)
            self.assertEqual(printed.split()[:2], [isomesh_client.__version__, "False"])
            self.assertTrue(printed.split()[2].startswith(folder))
            found = subprocess.run([sys.executable, "-c", "import isomesh"], env=environment, capture_output=True, text=True)
            self.assertIn("No module named 'isomesh'", found.stderr)  # that name is another project's

    def test_the_same_sources_make_the_same_packages(self):
        """Also in another folder; the source distribution has what makes it and the wheel."""
        code = "import backend, sys; print(backend.build_wheel(sys.argv[1]), backend.build_sdist(sys.argv[1]))"
        with tempfile.TemporaryDirectory() as folder:
            first, second = Path(folder, "first"), Path(folder, "second")
            for target, source in ((first, PACKAGE), (second, Path(folder) / f"isomesh_client-{isomesh_client.__version__}")):
                target.mkdir()
                names = subprocess.check_output([sys.executable, "-c", code, target], cwd=source, text=True).split()
                subprocess.check_call(["tar", "-xf", target / names[1], "-C", folder])
            self.assertEqual(names, [f"isomesh_client-{isomesh_client.__version__}{end}" for end in ("-py3-none-any.whl", ".tar.gz")])
            for name in names:
                self.assertEqual((first / name).read_bytes(), (second / name).read_bytes(), name)

    def test_its_version_is_the_projects(self):
        project = (ROOT / "CMakeLists.txt").read_text()
        self.assertIn(f"project(isomesh VERSION {isomesh_client.__version__} ", project)

    def test_generated_files_are_up_to_date(self):
        subprocess.check_call([sys.executable, PACKAGE / "generate", "--check"])

    def test_words_of_yaml_1_1_are_strings(self):
        """`off` without quotes is the boolean false for PyYAML."""
        loader = importlib.machinery.SourceFileLoader("generate", str(PACKAGE / "generate"))
        generate = importlib.util.module_from_spec(importlib.util.spec_from_loader("generate", loader))
        loader.exec_module(generate)
        for off in ("off", "'off'", '"off"'):
            text = f"components: {{schemas: {{MeshFormat: {{type: string, enum: [ply, {off}, on, yes, no]}}, {BARE}}}}}"
            self.assertIn("MeshFormat = Literal['ply', 'off', 'on', 'yes', 'no']", generate.types_of(text).texts[0])
        self.assertTrue(all(isinstance(each, str) for each in typing.get_args(isomesh_client.api.MeshFormat)))
        self.assertIn("off", typing.get_args(isomesh_client.api.MeshFormat))

    def test_help_describes_the_parameters(self):
        script = "import isomesh_client\nhelp(isomesh_client.api.JobOptions)\nhelp(isomesh_client.Client.mesh)"
        text = subprocess.check_output([sys.executable, "-c", script], text=True)
        described, call = text.split("Help on function mesh")
        for name in isomesh_client.api.JobOptions.__annotations__:
            self.assertRegex(described, rf"(?m)^ \|  {name}\n \|      \S")
            self.assertRegex(call, rf"\b{name}: '.*' = <default>")
        self.assertIn("lambda_", isomesh_client.api.JobOptions.__annotations__)
        self.assertIn("passes", typing.get_type_hints(isomesh_client.api.JobOptions))

    def mypy(self, code, config="[mypy]\n"):
        """What `mypy --strict` prints of a program with this code, as a user runs it."""
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "program.py").write_text(code)
            (Path(folder) / "mypy.ini").write_text(config)
            found = subprocess.run(
                [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", "--cache-dir", self.cache.name, "program.py"],
                cwd=folder, env={**os.environ, "MYPYPATH": str(PACKAGE / "src")}, capture_output=True, text=True,
            )
            self.assertEqual(found.stderr, "")
            return [line for line in found.stdout.splitlines() if " error: " in line]

    def test_types_hold(self):
        mypy = [sys.executable, "-m", "mypy", "--config-file", PACKAGE / "pyproject.toml", "--no-error-summary"]
        subprocess.check_call([*mypy, "--cache-dir", self.cache.name, PACKAGE / "src" / "isomesh_client"])

    def test_types_fit_the_readme(self):
        # This version of nibabel has no types.
        untyped = "[mypy]\n[mypy-nibabel.*]\nignore_missing_imports = True\n"
        self.assertEqual(self.mypy(examples("python"), config=untyped), [])

    def test_types_find_mistakes(self):
        head = "import isomesh_client\nclient = isomesh_client.Client()\n"
        right = """
options: isomesh_client.api.JobOptions = {"iso": 3, "formats": ["off"]}
client.mesh("x", iso="otsu", formats=["off", "glb"], lambda_=0.5, components={"keep": 1}, close=True).save("x.off")
client.mesh("x", accept=["frame-of-reference"], **options)
done = client.wait(client.submit("x", labels=[1, 2], draco={"position_bits": 12}))
print(done["mesh"]["triangles"], client.fetch(done).job["mesh"]["area_mm2"], client.download(done, "x.ply"))
"""
        self.assertEqual(self.mypy(head + right), [])
        mistakes = {
            "client.mesh('x', iso=1, pases=3)": 'Unexpected keyword argument "pases" for "mesh" of "Client"; did you mean "passes"?',
            "client.submit('x', iso=1, pases=3)": 'Unexpected keyword argument "pases"',
            "client.estimate('x', isoo=1)": 'Unexpected keyword argument "isoo"',
            "client.mesh('x', iso=1, passes='3')": 'expected "int"',
            "client.mesh('x', iso='otzu')": "Literal['otsu', ",
            "client.mesh('x', formats=['of'])": "Literal['of']",
            "client.mesh('x', components={'kep': 1})": "kep",
            "client.wait('x')['mesh']['aera_mm2']": "aera_mm2",
        }
        found = self.mypy(head + "\n".join(mistakes))
        self.assertEqual(len(found), len(mistakes), found)
        for number, (line, text) in enumerate(zip(found, mistakes.values()), start=3):
            self.assertTrue(line.startswith(f"program.py:{number}: "), line)
            self.assertIn(text, line)


if __name__ == "__main__":
    unittest.main()
