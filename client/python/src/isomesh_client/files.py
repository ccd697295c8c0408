"""Files of meshes: which ones a job has, and writing one so that it appears whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Iterable, Iterator, Optional, Union, cast, get_args

from . import api
from .errors import JobFailed

if TYPE_CHECKING:
    AnyJob = Union[api.Job, api.SucceededJob]

FINAL_STATES = ("succeeded", "failed", "cancelled")
_LONGEST_OBJ_HEAD = 100  # bytes, with the line that names the materials


def format_of(path: Path) -> str:
    """The format that a path's suffix names. Raises ValueError for any other suffix."""
    form = path.suffix.lower().lstrip(".")
    known = get_args(api.MeshFormat)
    if form not in known:
        raise ValueError(f"the suffix of {path.name!r} is not a mesh format; the formats are {', '.join(known)}")
    return form


def file_of(
    job: AnyJob, form: str, label: Optional[int] = None, labels: Iterable[api.LabelSummary] = ()
) -> api.MeshFile:
    """The job's file of that format, or that of one of its `labels`. Raises JobFailed for a job that failed or was cancelled, and
    ValueError if the job is not done or was not asked for the format."""
    mesh = job["mesh"]
    if mesh is None:
        if job["state"] in FINAL_STATES:
            raise JobFailed(cast(api.Job, job))
        raise ValueError(f"job {job['id']} is {job['state']}; call wait(job) first")
    files: Any = mesh["files"]
    if label is not None:
        files = next((each["files"] for each in labels if each["label"] == label), {})
    if form in files:
        return cast(api.MeshFile, files[form])
    of_label = "" if label is None else f" of the label {label}"
    has = ", ".join(files) or "none"
    raise ValueError(
        f"job {job['id']} has no file of the format {form!r}{of_label}; it has {has}. "
        f"Add formats=[{form!r}] to the call that starts the job."
    )


def _mode_of(target: Path) -> int:
    """The mode of the file that is replaced, or that of any new file; mkstemp's are for their owner alone."""
    try:
        return target.stat().st_mode & 0o777
    except OSError:
        mask = os.umask(0)
        os.umask(mask)
        return 0o666 & ~mask


@contextlib.contextmanager
def written(target: Path) -> Iterator[IO[bytes]]:
    """A file to write to, which takes the place of `target` at the end, and is removed on errors."""
    number, part = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
    try:
        with os.fdopen(number, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.chmod(part, _mode_of(target))
        os.replace(part, target)
    except BaseException:
        os.unlink(part)
        raise


class Arriving:
    """A file on its way to disk. In an OBJ, `materials` replaces the name of the file of materials: the first bytes
    wait until the line that has it is complete."""

    def __init__(self, file: IO[bytes], materials: Optional[bytes]) -> None:
        self.names_materials = False
        self._file, self._materials, self._head = file, materials, b""

    def write(self, at: int, piece: bytes) -> None:
        if at == 0:
            self._head, self.names_materials = b"", False
            self._file.seek(0)
            self._file.truncate()
        missing = _LONGEST_OBJ_HEAD - len(self._head)
        if missing > 0:
            self._head += piece[:missing]
            if len(self._head) == _LONGEST_OBJ_HEAD:
                self._write_head()
        self._file.write(piece[missing:])

    def finish(self) -> None:
        if len(self._head) < _LONGEST_OBJ_HEAD:
            self._write_head()

    def _write_head(self) -> None:
        line, head = b"\nmtllib mesh.mtl\n", self._head
        self.names_materials = self._materials is not None and line in head
        if self._materials is not None:
            head = head.replace(line, b"\nmtllib " + self._materials + b"\n", 1)
        self._file.write(head)
