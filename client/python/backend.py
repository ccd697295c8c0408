"""Makes the package for pip (PEP 517 and 660). It needs Python only, so `pip install` of this folder works without a network.

METADATA describes the package, README.md follows it, and the version is that of version.py. The same sources make the same bytes.
"""

import base64
import gzip
import hashlib
import io
import re
import sysconfig
import tarfile
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
PACKAGE = next(each.parent for each in sorted((HERE / "src").glob("*/__init__.py")))
VERSION = re.search('__version__ = "(.*)"', (PACKAGE / "version.py").read_text())[1]
NAME = f"{PACKAGE.name}-{VERSION}"
# Lists of what a package is made of, if docker/release has put them beside it, with their places in the wheel (PEP 770 and 639).
LISTS = {"sbom.cdx.json": "sboms", "third-party-licenses.gz": "licenses"}
LONG_AGO = (1980, 1, 1, 0, 0, 0)


def _metadata():
    head = (HERE / "METADATA").read_text().replace("VERSION", VERSION)
    return (head + "\n" + (HERE / "README.md").read_text()).encode()


def _tag():
    """A package with a library of its own is for one kind of machine, and for every version of Python."""
    if not list(PACKAGE.glob("*.so")):
        return "py3-none-any"
    return "py3-none-" + re.sub("[-.]", "_", sysconfig.get_platform())


def _sources():
    return sorted(
        each for each in PACKAGE.rglob("*") if each.is_file() and "__pycache__" not in each.parts and each.suffix != ".pyc"
    )


def _wheel(folder, files):
    tag, info = _tag(), f"{NAME}.dist-info"
    pure = str(tag.endswith("-any")).lower()
    about = f"Wheel-Version: 1.0\nGenerator: isomesh\nRoot-Is-Purelib: {pure}\nTag: {tag}\n"
    files = {**files, f"{info}/METADATA": _metadata(), f"{info}/WHEEL": about.encode()}
    for name, place in LISTS.items():
        if (HERE / name).exists():
            files[f"{info}/{place}/{name}"] = (HERE / name).read_bytes()
    record = ""
    with zipfile.ZipFile(Path(folder, f"{NAME}-{tag}.whl"), "w", zipfile.ZIP_DEFLATED) as wheel:
        for name, data in files.items():
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            record += f"{name},sha256={digest},{len(data)}\n"
            _put(wheel, name, data)
        _put(wheel, f"{info}/RECORD", (record + f"{info}/RECORD,,\n").encode())
    return f"{NAME}-{tag}.whl"


def _put(wheel, name, data):
    member = zipfile.ZipInfo(name, LONG_AGO)
    member.compress_type = zipfile.ZIP_DEFLATED
    member.external_attr = 0o100644 << 16
    wheel.writestr(member, data)


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    return _wheel(wheel_directory, {each.relative_to(HERE / "src").as_posix(): each.read_bytes() for each in _sources()})


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    return _wheel(wheel_directory, {f"{PACKAGE.name}.pth": f"{HERE / 'src'}\n".encode()})


def build_sdist(sdist_directory, config_settings=None):
    files = {each.relative_to(HERE).as_posix(): each.read_bytes() for each in _sources()}
    for name in ("METADATA", "README.md", "backend.py", "pyproject.toml"):
        files[name] = (HERE / name).read_bytes()
    files["PKG-INFO"] = _metadata()
    with Path(sdist_directory, f"{NAME}.tar.gz").open("wb") as file, gzip.GzipFile("", "wb", 9, file, 0) as packed, tarfile.open(
        fileobj=packed, mode="w", format=tarfile.PAX_FORMAT
    ) as archive:
        for name, data in files.items():
            member = tarfile.TarInfo(f"{NAME}/{name}")
            member.size = len(data)
            archive.addfile(member, io.BytesIO(data))
    return f"{NAME}.tar.gz"
