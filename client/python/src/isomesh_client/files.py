"""Files of meshes: which ones a job has, and writing one so that it appears whole or not at all."""

from __future__ import annotations

import contextlib
import os
import re
import secrets
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Iterable, Iterator, List, Optional, Union, cast, get_args

from . import api
from .errors import EmptySurface, JobFailed

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


def expect_surface(job: AnyJob, allow_empty: bool) -> None:
    """Raises EmptySurface for a mesh without triangles, unless that is allowed."""
    mesh = job["mesh"]
    if mesh is not None and mesh["empty"] and not allow_empty:
        raise EmptySurface(cast("api.SucceededJob", job))


def files_of_mesh(target: Path, is_by_labels: bool) -> List[Path]:
    """Every file that `Client.download` writes for `target`: first the mesh, then the materials of an OBJ of all labels."""
    if format_of(target) != "obj" or not is_by_labels:
        return [target]
    # Readers take several names from the line that names them, divided by blanks, and control characters end it.
    return [target, target.with_name(re.sub(r"[\0-\x20\\]", "_", target.with_suffix(".mtl").name))]


@contextlib.contextmanager
def written(target: Path) -> Iterator[IO[bytes]]:
    """A file to write to, which takes the place of `target` at the end, and is removed on errors. It keeps the mode of the
    file that it replaces; a new one has that of any new file."""
    # Without the target's name, which may be as long as a name can be.
    part = target.with_name(f".isomesh-{secrets.token_hex(8)}.part")
    try:
        replaced: Optional[int] = target.stat().st_mode & 0o777
    except OSError:
        replaced = None
    mode = 0o666 if replaced is None else replaced
    # The kernel applies the umask, which is the process's own: other threads must not see it change.
    with open(part, "xb", opener=lambda path, flags: os.open(path, flags, mode)) as file:
        try:
            yield file
            file.flush()
            os.fsync(file.fileno())
            file.close()  # Windows renames no open file
            if replaced is not None:
                os.chmod(part, replaced)
            os.replace(part, target)
        except BaseException:
            with contextlib.suppress(OSError):  # it writes what is left once more, which fails on a full disk
                file.close()
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
