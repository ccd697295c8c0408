"""A wheel for this kind of machine and for every version of Python: the library does not use Python's interface."""

import re
from pathlib import Path

from setuptools import Distribution, setup
from wheel.bdist_wheel import bdist_wheel

HERE = Path(__file__).resolve().parent
VERSION = re.search('__version__ = "(.*)"', (HERE / "src/isomesh_kernels/version.py").read_text())[1]

if not (HERE / "src/isomesh_kernels/_kernels.so").exists():
    raise SystemExit("There is no library here. Build it with -D ISOMESH_PYTHON=ON, and install the folder python of the build.")


class Binary(Distribution):
    def has_ext_modules(self):
        return True


class Wheel(bdist_wheel):
    def get_tag(self):
        return "py3", "none", super().get_tag()[2]


setup(
    version=VERSION,
    install_requires=[f"isomesh-client=={VERSION}", "numpy"],
    distclass=Binary,
    cmdclass={"bdist_wheel": Wheel},
)
