"""isomesh's PLY files: binary, little-endian, with float coordinates and three corners per face."""

from __future__ import annotations

import sys
from array import array
from typing import Any, Dict, Iterator, List, Optional, Tuple, Union

from .errors import WrongAnswer

_HEADER_END = b"end_header\n"
_LONGEST_HEADER = 1 << 22  # with a comment for each of 65535 labels
_COMMENT = "comment isomesh, millimetres, "


def parse(source: Union[bytes, bytearray, memoryview]) -> Tuple[Any, Any, Any, str]:
    """Vertices, faces, labels or None, and the space. Raises WrongAnswer for a file of another form."""
    data = memoryview(source).cast("B")
    elements, long_labels = _header_of(bytes(data[:_LONGEST_HEADER]))
    label = elements.get("label", "")
    vertices, faces = int(elements["vertex"]), int(elements["face"])
    begin = int(elements["begin"])
    vertex_bytes, face_bytes = 12 * vertices, (17 if label else 13) * faces
    if len(data) != begin + vertex_bytes + face_bytes:
        raise WrongAnswer("the size of the PLY file does not match its header")
    records = data[begin + vertex_bytes :]
    if bytes(records[:: 17 if label else 13]).strip(b"\x03"):
        raise WrongAnswer("the PLY file has a face that is not a triangle")
    labels = shaped(_columns(records, faces, 13, 4), "i" if label == "int" else "I", faces) if label else None
    return (
        shaped(data[begin : begin + vertex_bytes], "f", vertices, 3),
        shaped(_columns(records, faces, 1, 12), "I", faces, 3),
        _long(labels, long_labels) if long_labels else labels,
        elements["space"],
    )


def pieces(vertices: Any, faces: Any, labels: Any, space: str) -> Iterator[bytes]:
    """The bytes of the file, as the server writes them. Raises ValueError for arrays of other shapes
    and for faces of vertices that do not exist."""
    points = _bytes_of("vertices", vertices, "f", 3)
    corners = _bytes_of("faces", faces, "I", 3, below=len(vertices))
    labels, long_labels = _numbered(labels)
    kind = _kind_of(labels)
    values = b"" if labels is None else _bytes_of("labels", labels, kind)
    if labels is not None and len(labels) != len(faces):
        raise ValueError(f"there are {len(labels)} labels for {len(faces)} faces")
    of_label = "" if labels is None else f"property {'uint' if kind == 'I' else 'int'} label\n"
    yield (
        f"ply\nformat binary_little_endian 1.0\n{_COMMENT}{space.upper()}\n{long_labels}element vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar uint vertex_indices\n{of_label}end_header\n"
    ).encode()
    yield points
    size = 13 if labels is None else 17
    records = bytearray(size * len(faces))
    records[::size] = b"\x03" * len(faces)
    for byte in range(12):
        records[1 + byte :: size] = corners[byte::12]
    for byte in range(size - 13):
        records[13 + byte :: size] = values[byte::4]
    yield bytes(records)


def shaped(data: Any, kind: str, *shape: int) -> Any:
    """Little-endian bytes as an array of that shape: numpy's, or a memoryview without numpy."""
    if sys.byteorder != "little":
        data = memoryview(_swapped(bytes(data), kind))
    try:
        import numpy
    except ImportError:
        pass
    else:
        return numpy.frombuffer(bytes(data), numpy.dtype(kind)).reshape(shape).copy()
    # Newer stubs want the kind as a literal.
    view: Any = memoryview(bytes(data))
    if 0 in shape:  # a memoryview cannot have this shape
        return view[:0].cast(kind)
    return view.cast(kind, shape)


def _long(numbers: Any, labels: List[int]) -> Any:
    """Labels of 64 bits, which PLY cannot hold: its faces have numbers from 1, and comments tell the labels."""
    if len(numbers) and not 1 <= min(numbers) <= max(numbers) <= len(labels):
        raise WrongAnswer("the PLY file has a face of a label that it does not name")
    return shaped(array("q", (labels[number - 1] for number in numbers)).tobytes(), "q", len(numbers))


def _numbered(labels: Any) -> Tuple[Any, str]:
    """The inverse of `_long`: numbers and comments for labels that need more than 32 bits. Others are unchanged, or of
    32 bits."""
    view = labels if isinstance(labels, memoryview) else getattr(labels, "dtype", None)
    if labels is None or view is None or view.itemsize <= 4:
        return labels, ""
    found = sorted({int(label) for label in labels})
    if not found or (found[0] >= -(1 << 31) and found[-1] < 1 << 31):
        return memoryview(array("i", map(int, labels))), ""
    if found[0] >= 0 and found[-1] < 1 << 32:
        return memoryview(array("I", map(int, labels))), ""
    number = {label: at for at, label in enumerate(found, 1)}
    comments = "".join(f"comment label {at} is {label}\n" for label, at in number.items())
    return memoryview(array("I", (number[int(label)] for label in labels))), comments


def _header_of(text: bytes) -> Tuple[Dict[str, str], List[int]]:
    """The counts of elements, the space, where the data begins, and the type of the labels; and the labels that
    faces have by number."""
    end = text.find(_HEADER_END)
    lines = text[: max(end, 0)].decode("ascii", "replace").splitlines()
    if lines[:2] != ["ply", "format binary_little_endian 1.0"]:
        raise WrongAnswer("the file is not a binary, little-endian PLY file")
    properties = [line for line in lines if line.startswith("property ")]
    known = [f"property float {axis}" for axis in "xyz"] + ["property list uchar uint vertex_indices"]
    labels = [line.split()[1] for line in properties[4:] if line.split()[2:] == ["label"]]
    counts = dict(line.split()[1:3] for line in lines if line.startswith("element "))
    if properties[:4] != known or len(properties) != 4 + len(labels) or list(counts) != ["vertex", "face"]:
        raise WrongAnswer("isomesh did not write this PLY file")
    space = "ras" if f"{_COMMENT}RAS" in lines else "lps"
    found = {**counts, "space": space, "begin": str(end + len(_HEADER_END))}
    told = [line.split() for line in lines if line.startswith("comment label ")]
    try:
        long_labels = [int(words[4]) for words in told]
    except (ValueError, IndexError) as error:
        raise WrongAnswer("the PLY file has a comment on a label that says none") from error
    return {**found, "label": labels[0]} if labels else found, long_labels


def _columns(records: memoryview, count: int, begin: int, width: int) -> memoryview:
    """The `width` bytes from `begin` on of each record, joined."""
    size = len(records) // count if count else 1
    out = bytearray(width * count)
    for byte in range(width):
        out[byte::width] = records[begin + byte :: size]
    return memoryview(out)


def _kind_of(labels: Any) -> str:
    is_unsigned = "I" in labels.format if isinstance(labels, memoryview) else "uint" in str(getattr(labels, "dtype", ""))
    return "I" if is_unsigned else "i"


def _bytes_of(name: str, values: Any, kind: str, *columns: int, below: Optional[int] = None) -> bytes:
    """The inverse of `shaped`, for arrays that the caller may have changed."""
    if isinstance(values, memoryview):  # which is read-only
        data = values.tobytes()
        return data if sys.byteorder == "little" else _swapped(data, kind)
    import numpy

    found = numpy.asarray(values)
    if found.ndim != 1 + len(columns) or found.shape[1:] != columns:
        raise ValueError(f"{name} must have the shape {('n', *columns)}, and has the shape {found.shape}")
    if below is not None and found.size and not (0 <= found.min() and found.max() < below):
        raise ValueError(f"{name} must be from 0 to {below - 1}, and are from {found.min()} to {found.max()}")
    return found.astype(numpy.dtype(kind).newbyteorder("<")).tobytes()


def _swapped(data: bytes, kind: str) -> bytes:
    numbers = array(kind, data)
    numbers.byteswap()
    return numbers.tobytes()
