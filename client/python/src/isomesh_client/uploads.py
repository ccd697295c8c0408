"""The body of an upload: a file, several files as one TAR archive, or samples in memory."""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import re
import tarfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterator, List, Optional, Sequence, Tuple, Union

from .errors import warn

if TYPE_CHECKING:
    from .api import SampleType

_PIECE = 1 << 20
_MOST_FILES = 20000  # as many as the server unpacks
_MOST_LINKS = 1000  # to folders, which links can multiply
_LONGEST_HEADER = 1 << 20
# The suffixes of a header and of its samples. A program writes one of each.
_PAIRS = (
    ((".hdr", ".hdr.gz"), (".img", ".img.gz")),
    ((".HEAD",), (".BRIK", ".BRIK.gz", ".BRIK.bz2")),
    ((".PAR",), (".REC",)),
    ((".par",), (".rec",)),
)


@dataclass
class Body:
    """A body of known size. Its bytes are read while they are sent, never held whole in memory."""

    size: int
    pieces: Callable[[], Iterator[bytes]]
    name: str = ""
    query: Dict[str, str] = field(default_factory=dict)


# --- Files ---------------------------------------------------------------------------------------


def of_bytes(data: Union[bytes, bytearray, memoryview], name: str = "") -> Body:
    view = memoryview(data).cast("B")
    return Body(len(view), lambda: (bytes(view[at : at + _PIECE]) for at in range(0, len(view), _PIECE)), name)


def of_paths(paths: Sequence[Path]) -> Body:
    """The files of all paths. A folder means every file below it except links; the server skips what is
    no part of a volume. A header brings the data files that it names."""
    members: Dict[str, Path] = {}
    for path in paths:
        for name, file in _files_of(path):
            if name in members and not members[name].samefile(file):
                raise ValueError(f"{file}: two files of this upload have the same name")
            members[name] = file
    name = Path(os.path.abspath(paths[0])).name
    if len(members) == 1 and not paths[0].is_dir():
        (file,) = members.values()
        size = file.stat().st_size
        return Body(size, lambda: _read(file, size), name)
    return _tar(members, name)


def files_of(source: Any) -> List[Path]:
    """The files that `of_source` would send, for a source that is no array. Also those of a source that it rejects."""
    paths = source if isinstance(source, (list, tuple)) else [source]
    files: List[Path] = []
    for path in (Path(each) for each in paths if isinstance(each, (str, os.PathLike)) and each != ""):
        try:
            files += [file for _, file in _files_of(path)]
        except (OSError, ValueError):
            files.append(path)
            with contextlib.suppress(OSError, ValueError):  # a name that no file can have
                files += path.rglob("*")
    return files


def _path(source: Union[str, os.PathLike[str]]) -> Path:
    if source == "":
        # A Path would make it the working folder, and that would be uploaded.
        raise FileNotFoundError("the path of the file to upload is empty")
    return Path(source)


def _files_of(path: Path) -> List[Tuple[str, Path]]:
    if path.is_dir():
        return _files_below(path)
    if not path.is_file():
        raise FileNotFoundError(f"there is no file or folder {path}")
    suffix = path.suffix.lower()
    if suffix == ".mhd":
        return _header_and_data(path, "=", "elementdatafile")
    if suffix == ".nhdr":
        return _header_and_data(path, ":", "datafile")
    for header, samples in _PAIRS:
        for suffix in header + samples:
            stem = path.name[: -len(suffix)]
            if stem and path.name.endswith(suffix):
                pair = _one_of(path, stem, header) + _one_of(path, stem, samples)
                return [(file.name, file) for file in pair]
    return [(path.name, path)]


def _one_of(path: Path, stem: str, suffixes: Sequence[str]) -> List[Path]:
    """The header or the samples of a pair: ``path`` itself, or else the first that is beside it."""
    files = [path.with_name(stem + suffix) for suffix in suffixes]
    return [path] if path in files else [file for file in files if file.is_file()][:1]


def _files_below(folder: Path) -> List[Tuple[str, Path]]:
    """All files; links are followed, as all files of a DataLad dataset are links to objects elsewhere."""
    found: List[Tuple[str, Path]] = []
    waiting: List[Tuple[Path, Tuple[str, ...]]] = [(folder, ())]
    links = 0
    while waiting:
        at, above = waiting.pop()
        real = os.path.realpath(at)
        if real in above:
            raise ValueError(f"{at} leads back to a folder that it is in, by a link; remove the link")
        for file in at.iterdir():
            if file.name == ".git":  # the objects of a dataset, which the links beside it name
                continue
            if file.is_symlink() and not file.exists():
                if file.name.startswith("."):  # editors mark a file that is open so (.#name)
                    continue
                raise FileNotFoundError(
                    f"{file} is a link to a file that is not there; get the file, in a dataset with 'datalad get', "
                    "or remove the link"
                )
            if file.is_dir():
                links += file.is_symlink()
                if links > _MOST_LINKS:
                    raise ValueError(f"{folder} has more than {_MOST_LINKS} links to folders. Upload its folders one by one")
                waiting.append((file, (*above, real)))
            elif file.is_file():
                found.append((file.relative_to(folder).as_posix(), file))
        if len(found) > _MOST_FILES:
            raise ValueError(f"{folder} has more than {_MOST_FILES} files")
    if not found:
        raise ValueError(f"{folder} has no files to upload")
    return sorted(found)


def _header_and_data(path: Path, sign: str, wanted: str) -> List[Tuple[str, Path]]:
    with path.open("rb") as file:
        lines = [line.strip() for line in file.read(_LONGEST_HEADER).decode("latin-1").split("\n")]
    names: List[str] = []
    for at, line in enumerate(lines):
        key, found, value = (part.strip() for part in line.partition(sign))
        if not found or key.replace(" ", "").lower() != wanted or value.lower() == "local":
            continue
        if value.startswith("LIST"):
            names = lines[at + 1 :]
        else:
            names = _names_like(path.parent, value.split()[0]) if "%" in value else [value]
        break
    files = [(path.name, path)]
    for name in names:
        # Data outside of the header's folder is not sent: the server rejects such a header.
        below = os.path.normpath(name)
        if name and not os.path.isabs(below) and not below.startswith("..") and below != path.name:
            files.append((Path(below).as_posix(), path.parent / below))
    return files


def _names_like(folder: Path, pattern: str) -> List[str]:
    """The files that a pattern such as slice%03d.raw may mean; the server selects among them."""
    parts = re.fullmatch(r"([^%]*)%\d*[a-z](.*)", pattern)
    if parts is None:
        return []
    like = re.compile(re.escape(parts[1]) + r"[ \d]+" + re.escape(parts[2]))
    return sorted(each.name for each in folder.iterdir() if like.fullmatch(each.name))


def _tar(members: Dict[str, Path], name: str) -> Body:
    """A TAR archive without owners and times, so the same files make the same archive."""
    parts: List[Tuple[bytes, Path, int]] = []
    for member, path in members.items():
        info = tarfile.TarInfo(member)
        info.size = path.stat().st_size
        parts.append((info.tobuf(tarfile.PAX_FORMAT), path, info.size))

    def padding(size: int) -> bytes:
        return bytes(-size % tarfile.BLOCKSIZE)

    def pieces() -> Iterator[bytes]:
        for lead, path, size in parts:
            yield lead
            yield from _read(path, size)
            yield padding(size)
        yield bytes(2 * tarfile.BLOCKSIZE)

    size = sum(len(lead) + each + len(padding(each)) for lead, _, each in parts)
    return Body(size + 2 * tarfile.BLOCKSIZE, pieces, name)


def _read(path: Path, size: int) -> Iterator[bytes]:
    with path.open("rb") as file:
        while size > 0:
            piece = file.read(min(_PIECE, size))
            if not piece:
                raise ValueError(f"{path} became shorter during the upload")
            size -= len(piece)
            yield piece


# --- Samples in memory ---------------------------------------------------------------------------


@dataclass(frozen=True)
class Raw:
    """Describes raw samples, of which x runs fastest. Lengths are in millimetres, `origin` and
    `direction` in LPS. `direction` has nine numbers, row by row; its columns are the axes."""

    dims: Tuple[int, int, int]
    type: SampleType
    spacing: Tuple[float, float, float] = (1, 1, 1)
    origin: Tuple[float, float, float] = (0, 0, 0)
    direction: Sequence[float] = (1, 0, 0, 0, 1, 0, 0, 0, 1)
    big_endian: bool = False

    def query(self) -> Dict[str, str]:
        return {
            "dims": ",".join(str(int(each)) for each in self.dims),
            "type": self.type,
            "spacing": _joined(steps_of(self.spacing)),
            "origin": _joined(self.origin),
            "direction": _joined(self.direction),
            "byte_order": "big" if self.big_endian else "little",
        }


def _joined(numbers: Sequence[float]) -> str:
    return ",".join(repr(float(number)) for number in numbers)


def steps_of(spacing: Any) -> Tuple[float, float, float]:
    """The three lengths of a `spacing` that a caller gave."""
    try:
        steps = [] if isinstance(spacing, (str, bytes)) else [float(step) for step in spacing]
    except (TypeError, ValueError) as error:
        raise TypeError(f"spacing must be three numbers, not {spacing!r}") from error
    if len(steps) != 3 or not all(math.isfinite(step) and step > 0 for step in steps):
        raise ValueError(f"spacing must be three positive numbers, the millimetres along x, y and z, not {spacing!r}")
    return (steps[0], steps[1], steps[2])


def placed(affine: Any, space: str) -> Dict[str, Any]:
    """Spacing, origin and direction (LPS) of a 4 x 4 or 3 x 4 matrix that maps indices to
    millimetres in `space`."""
    rows = [[float(number) for number in row] for row in affine]
    if len(rows) not in (3, 4) or any(len(row) != 4 for row in rows):
        raise ValueError("the affine must be a 4 x 4 matrix")
    if not all(math.isfinite(number) for row in rows for number in row):
        raise ValueError("the affine has a number that is not finite")
    if space not in ("ras", "lps"):
        raise ValueError(f"affine_space must be 'ras' or 'lps', not {space!r}")
    # RAS and LPS differ in the signs of x and y.
    signs = (-1, -1, 1) if space == "ras" else (1, 1, 1)
    rows = [[sign * number for number in row] for sign, row in zip(signs, rows)]
    spacing = [math.sqrt(sum(row[axis] ** 2 for row in rows)) for axis in range(3)]
    if min(spacing) == 0:
        raise ValueError("the affine has an axis of length zero")
    direction = [row[axis] / spacing[axis] for row in rows for axis in range(3)]
    # -0.0 becomes 0.0: the same place has one spelling.
    return {
        "spacing": tuple(spacing),
        "origin": tuple(row[3] + 0.0 for row in rows),
        "direction": tuple(number + 0.0 for number in direction),
    }


def of_source(
    source: Any, affine: Optional[Any], space: str, spacing: Optional[Sequence[float]], raw: Optional[Raw]
) -> Body:
    """The body for anything that `Client.upload` accepts."""
    is_array = False
    if isinstance(source, (str, os.PathLike)):
        body = of_paths([_path(source)])
    elif isinstance(source, (bytes, bytearray)) or type(source) is memoryview:
        body = of_bytes(source)
    elif isinstance(source, (list, tuple)) and source and all(isinstance(p, (str, os.PathLike)) for p in source):
        body = of_paths([_path(each) for each in source])
    else:
        is_array = True
        if hasattr(source, "dataobj") and hasattr(source, "affine"):
            if affine is None and spacing is None:
                affine = _affine_of_image(source)
            source = source.dataobj
        elif not hasattr(source, "__array__"):
            raise TypeError(f"cannot upload a {type(source).__name__}: give a path, bytes, an array or an image")
        body = of_array(source, affine, space, spacing)
    if is_array and raw is not None:
        raise ValueError("raw is for files and bytes; an array needs no description")
    if not is_array and affine is not None:
        raise ValueError("affine is for arrays; a file has its own geometry")
    if raw is not None:
        body.query = raw.query()
    if not is_array and spacing is not None:
        body.query = {**body.query, "spacing": _joined(steps_of(spacing))}
    return body


# The spatial units of NIfTI, by nibabel's names. The server reads an unknown unit as millimetres, too.
_MILLIMETRES = {"unknown": 1.0, "mm": 1.0, "meter": 1000.0, "micron": 0.001}


def _affine_of_image(image: Any) -> Any:
    """The image's affine in millimetres: nibabel leaves it in the unit of the header."""
    header: Any = getattr(image, "header", None)
    if not hasattr(header, "get_xyzt_units"):
        return image.affine
    try:
        scale = _MILLIMETRES[header.get_xyzt_units()[0]]
    except KeyError as error:
        raise ValueError(f"the spatial unit {error} of the image's header is unknown; give an affine") from error
    affine = _scaled(image.affine, scale)
    _warn_of_other_form(header, affine, scale, image.dataobj.shape[:3])
    return affine


def _scaled(affine: Any, scale: float) -> List[List[float]]:
    return [[float(number) * scale for number in row] for row in list(affine)[:3]]


def _warn_of_other_form(header: Any, affine: List[List[float]], scale: float, dims: Sequence[int]) -> None:
    """The server's note forms-differ for a NIfTI image whose affine is its sform."""
    try:
        forms = [getattr(header, get)(coded=True)[0] for get in ("get_sform", "get_qform")]
    except (AttributeError, ValueError):
        return  # another kind of header, or a qform that is not a rotation
    if any(form is None for form in forms):
        return
    sform, qform = (_scaled(form, scale) for form in forms)
    step = min(math.hypot(*(row[axis] for row in affine)) for axis in range(3))
    apart = _distance(affine, qform, dims)
    if apart > step / 100 and _distance(affine, sform, dims) <= step / 100:
        warn(
            f"The sform and qform of the NIfTI header place samples up to {apart:.1f} mm apart. The sform was used. "
            "affine=image.get_qform() selects the qform, if the header's unit is millimetres. (forms-differ)"
        )


def _distance(one: List[List[float]], other: List[List[float]], dims: Sequence[int]) -> float:
    """The largest distance between the two positions of a sample, which is at a corner."""
    corners = itertools.product(*((0, size - 1) for size in dims))
    rows = [[a - b for a, b in zip(*pair)] for pair in zip(one, other)]
    return max(
        math.hypot(*(row[3] + sum(n * index for n, index in zip(row, corner)) for row in rows)) for corner in corners
    )


def described(
    array: Any, affine: Optional[Any], space: str, spacing: Optional[Sequence[float]]
) -> Tuple[Any, Any, Raw]:
    """The samples of an array with the axes x, y and z as a numpy array of three axes, the type to have them in, and
    their description."""
    import numpy

    samples = numpy.asanyarray(array)
    while samples.ndim > 3 and samples.shape[-1] == 1:
        samples = samples[..., 0]
    if samples.ndim != 3 or samples.size == 0:
        raise ValueError(f"the array must have three axes and no empty one; its shape is {samples.shape}")
    if numpy.any(getattr(samples, "mask", False)):
        # The values under a mask mean nothing, and only the caller knows what to mesh there.
        raise ValueError("the array has masked samples; fill them, for example with array.filled(0)")
    target = _sendable(numpy, samples)
    if affine is not None and spacing is not None:
        raise ValueError("give either affine or spacing, not both")
    if affine is None:
        # The default is that of raw samples.
        steps = (1.0, 1.0, 1.0) if spacing is None else steps_of(spacing)
        affine = [[steps[row] if row == column else 0.0 for column in range(4)] for row in range(3)]
        space = "lps"
    x, y, z = samples.shape
    return samples, target, Raw((x, y, z), target.name, **placed(affine, space))


def of_array(array: Any, affine: Optional[Any], space: str, spacing: Optional[Sequence[float]]) -> Body:
    """The samples of a numpy array with the axes x, y and z, sent plane by plane."""
    import numpy

    samples, target, raw = described(array, affine, space, spacing)
    little = target.newbyteorder("<")

    def pieces() -> Iterator[bytes]:
        for index in range(raw.dims[2]):
            plane: bytes = numpy.asarray(samples[:, :, index]).astype(little).tobytes(order="F")
            yield plane

    return Body(samples.size * target.itemsize, pieces, query=raw.query())


def _sendable(numpy: Any, samples: Any) -> Any:
    """The type to send samples in: their own if the server knows it, else one that holds all values."""
    kind, size = samples.dtype.kind, samples.dtype.itemsize
    if kind in "iu" and size <= 4 or kind == "f" and size in (4, 8):
        return samples.dtype.newbyteorder("=")
    if kind == "b":
        return numpy.dtype("uint8")
    if kind == "f" and size == 2:
        return numpy.dtype("float32")
    if kind in "iu":
        low, high = int(samples.min()), int(samples.max())
        for name in ("int32", "uint32"):
            limits = numpy.iinfo(name)
            if limits.min <= low and high <= limits.max:
                return numpy.dtype(name)
        raise ValueError(f"the samples, from {low} to {high}, do not fit into 32 bits; convert the array to float64")
    raise TypeError(f"samples of type {samples.dtype} cannot be uploaded; convert the array to integers or floats")
