"""isomesh's PLY files: binary, little-endian, with float coordinates and three corners per face.

A label is a property of vertices, because each label has vertices of its own. Arrays whose labels share vertices, or
without colours, have it as a property of faces, as the server's files had it before they had colours."""

from __future__ import annotations

import re
import sys
from array import array
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Tuple, Union

from .errors import WrongAnswer

_HEADER_END = b"end_header\n"
_LONGEST_HEADER = 1 << 22  # with a comment for each of 65535 labels
_COMMENT = "comment isomesh, millimetres, SPACE="
_SAYS_RAS = re.compile("comment isomesh, [a-z]+, (SPACE=)?RAS")  # older servers wrote the letters alone
_POSITION = "".join(f"property float {axis}\n" for axis in "xyz")
_COLOR = "".join(f"property uint8 {channel}\n" for channel in ("red", "green", "blue"))
_CORNERS = "property list uchar uint vertex_indices\n"
_LABEL = {"i": "property int label\n", "I": "property uint label\n"}


class _Header(NamedTuple):
    vertices: int
    faces: int
    begin: int  # where the vertices begin
    space: str
    has_colors: bool
    label_of: str  # the element that has labels: "vertex", "face" or "" for none
    label_kind: str
    long_labels: List[int]  # by number, from 1


def parse(source: Union[bytes, bytearray, memoryview]) -> Dict[str, Any]:
    """The members of a Mesh: vertices, faces, labels, colors (both may be None) and space. Raises WrongAnswer for a file
    of another form."""
    data = memoryview(source).cast("B")
    header = _header_of(bytes(data[:_LONGEST_HEADER]))
    points, triangles, kind = header.vertices, header.faces, header.label_kind
    vertex_size = 12 + (3 if header.has_colors else 0) + (4 if header.label_of == "vertex" else 0)
    face_size = 17 if header.label_of == "face" else 13
    end = header.begin + vertex_size * points
    if len(data) != end + face_size * triangles:
        raise WrongAnswer("the size of the PLY file does not match its header")
    vertices, faces = data[header.begin : end], data[end:]
    if bytes(faces[::face_size]).strip(b"\x03"):
        raise WrongAnswer("the PLY file has a face that is not a triangle")
    corners = shaped(_columns(faces, triangles, 1, 12), "I", triangles, 3)
    if triangles and _largest(corners) >= points:
        raise WrongAnswer("the PLY file has a face of a vertex that does not exist")
    labels = None
    if header.label_of == "face":
        labels = shaped(_columns(faces, triangles, 13, 4), kind, triangles)
    elif header.label_of == "vertex":
        labels = _of_faces(shaped(_columns(vertices, points, vertex_size - 4, 4), kind, points), corners, kind)
    return {
        "vertices": shaped(_columns(vertices, points, 0, 12), "f", points, 3),
        "faces": corners,
        "labels": _long(labels, header.long_labels) if header.long_labels else labels,
        "colors": shaped(_columns(vertices, points, 12, 3), "B", points, 3) if header.has_colors else None,
        "space": header.space,
    }


def pieces(vertices: Any, faces: Any, labels: Any, colors: Any, space: str) -> Iterator[bytes]:
    """The bytes of the file, as the server writes them. Raises ValueError for arrays of other shapes
    and for faces of vertices that do not exist."""
    of_vertex, vertex = [(_bytes_of("vertices", vertices, "f", 3), 12)], _POSITION
    corners = _bytes_of("faces", faces, "I", 3, below=len(vertices))
    of_face, face = [(b"\x03" * len(faces), 1), (corners, 12)], _CORNERS
    if colors is not None:
        if len(colors) != len(vertices):
            raise ValueError(f"there are {len(colors)} colors for {len(vertices)} vertices; set colors to None to save none")
        of_vertex.append((_bytes_of("colors", colors, "B", 3, below=256), 3))
        vertex += _COLOR
    labels, long_labels = _numbered(labels)
    if labels is not None:
        kind = _kind_of(labels)
        values = _bytes_of("labels", labels, kind)
        if len(labels) != len(faces):
            raise ValueError(f"there are {len(labels)} labels for {len(faces)} faces")
        labels_of_vertices = None if colors is None else _of_vertices(values, corners, len(vertices))
        if labels_of_vertices is None:
            of_face.append((values, 4))
            face += _LABEL[kind]
        else:
            of_vertex.append((labels_of_vertices, 4))
            vertex += _LABEL[kind]
    yield (
        f"ply\nformat binary_little_endian 1.0\n{_COMMENT}{space.upper()}\n{long_labels}element vertex {len(vertices)}\n"
        f"{vertex}element face {len(faces)}\n{face}end_header\n"
    ).encode()
    yield _records(of_vertex, len(vertices))
    yield _records(of_face, len(faces))


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


def _of_faces(labels: Any, corners: Any, kind: str) -> Any:
    """The label of each face: that of its first corner."""
    if isinstance(labels, memoryview):
        found = array(kind, (labels[vertex] for vertex in array("I", corners.tobytes())[::3]))
        return memoryview(found).toreadonly()
    return labels[corners[:, 0]]


def _largest(corners: Any) -> int:
    return max(array("I", corners.tobytes())) if isinstance(corners, memoryview) else int(corners.max())


def _of_vertices(labels: bytes, corners: bytes, count: int) -> Optional[bytes]:
    """The label of each vertex: that of its faces, or 0 without faces. None if a vertex has faces of two labels. All of
    them are numbers of 32 bits."""
    try:
        import numpy
    except ImportError:
        pass
    else:
        vertices = numpy.frombuffer(corners, "<u4")
        wanted = numpy.repeat(numpy.frombuffer(labels, "<u4"), 3)
        found = numpy.zeros(count, "<u4")
        found[vertices] = wanted
        return found.tobytes() if numpy.array_equal(found[vertices], wanted) else None
    numbers = array("I", labels)
    columns = [array("I", corners)[corner::3] for corner in range(3)]
    if sys.byteorder != "little":
        for column in columns:
            column.byteswap()
    each = array("I", bytes(4 * count))
    for column in columns:
        for vertex, label in zip(column, numbers):
            each[vertex] = label
    is_one = all(each[vertex] == label for column in columns for vertex, label in zip(column, numbers))
    return each.tobytes() if is_one else None


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


def _header_of(text: bytes) -> _Header:
    end = text.find(_HEADER_END)
    lines = text[: max(end, 0)].decode("ascii", "replace").splitlines()
    if lines[:2] != ["ply", "format binary_little_endian 1.0"]:
        raise WrongAnswer("the file is not a binary, little-endian PLY file")
    counts: Dict[str, str] = {}
    properties: Dict[str, str] = {}
    for line in lines:
        if line.startswith("element "):
            _, element, counts[element] = (line.split() + ["", ""])[:3]
            properties[element] = ""
        elif line.startswith("property ") and properties:
            properties[list(properties)[-1]] += line + "\n"
    vertex, face = properties.get("vertex", ""), properties.get("face", "")
    has_colors = vertex.startswith(_POSITION + _COLOR)
    # Labels are the only other property.
    rest = {"vertex": vertex[len(_POSITION) + (len(_COLOR) if has_colors else 0) :], "face": face[len(_CORNERS) :]}
    labels = [(element, kind) for element in rest for kind, name in _LABEL.items() if rest[element] == name]
    is_ours = vertex.startswith(_POSITION) and face.startswith(_CORNERS) and list(counts) == ["vertex", "face"]
    if not is_ours or len(labels) > 1 or sum(map(bool, rest.values())) != len(labels):
        raise WrongAnswer("isomesh did not write this PLY file")
    told = [line.split() for line in lines if line.startswith("comment label ")]
    try:
        long_labels = [int(words[4]) for words in told]
    except (ValueError, IndexError) as error:
        raise WrongAnswer("the PLY file has a comment on a label that says none") from error
    if not all(re.fullmatch("[0-9]{1,10}", count) for count in counts.values()):
        raise WrongAnswer("the PLY file does not say how many vertices and faces it has")
    return _Header(
        vertices=int(counts["vertex"]),
        faces=int(counts["face"]),
        begin=end + len(_HEADER_END),
        space="ras" if any(map(_SAYS_RAS.fullmatch, lines)) else "lps",
        has_colors=has_colors,
        label_of=labels[0][0] if labels else "",
        label_kind=labels[0][1] if labels else "",
        long_labels=long_labels,
    )


def _records(columns: List[Tuple[bytes, int]], count: int) -> bytes:
    """The inverse of `_columns`: records of the bytes of several columns, each with its width."""
    if len(columns) == 1:
        return columns[0][0]
    size = sum(width for _, width in columns)
    out, begin = bytearray(size * count), 0
    for data, width in columns:
        for byte in range(width):
            out[begin + byte :: size] = data[byte::width]
        begin += width
    return bytes(out)


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
    if name == "faces" and found.size and found.dtype.kind not in "iu":
        raise ValueError(f"faces must be integers, and are of the type {found.dtype}")
    if found.ndim != 1 + len(columns) or found.shape[1:] != columns:
        raise ValueError(f"{name} must have the shape {('n', *columns)}, and has the shape {found.shape}")
    if kind == "B" and found.dtype.kind not in "iu":
        raise ValueError(f"{name} must be integers from 0 to 255, and are of the type {found.dtype}")
    if below is not None and found.size and not (0 <= found.min() and found.max() < below):
        raise ValueError(f"{name} must be from 0 to {below - 1}, and are from {found.min()} to {found.max()}")
    return found.astype(numpy.dtype(kind).newbyteorder("<")).tobytes()


def _swapped(data: bytes, kind: str) -> bytes:
    numbers = array(kind, data)
    numbers.byteswap()
    return numbers.tobytes()
