"""A mesh as arrays."""

from __future__ import annotations

import sys
from array import array
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Dict, Optional, Union

from .errors import WrongAnswer

if TYPE_CHECKING:
    from .api import Job

_HEADER_END = b"end_header\n"
_LONGEST_HEADER = 4096


@dataclass(frozen=True)
class Mesh:
    """A surface of triangles, in millimetres.

    vertices  float32, shape (n, 3)
    faces     uint32, shape (m, 3): indices of vertices, counter-clockwise seen from outside
    labels    int32 or uint32, shape (m,): the label of each face; None unless the job was by labels
    space     "lps" (DICOM's patient space), or "ras" (NIfTI's and nibabel's)
    job       the job that made it, with all that the server measured; None when read from a file

    The arrays are numpy's where numpy is installed. Without it they are memoryviews of the same
    shapes: `vertices[7, 0]`, `len(faces)`, `faces.tolist()`, and anything that takes buffers.
    """

    vertices: Any
    faces: Any
    labels: Optional[Any] = None
    space: str = "lps"
    job: Optional[Job] = None

    def in_space(self, space: str) -> Mesh:
        """The same surface in "ras" or "lps": x and y change their signs, nothing else does."""
        if space not in ("ras", "lps"):
            raise ValueError("space must be 'ras' or 'lps'")
        if space == self.space:
            return self
        return Mesh(_turned(self.vertices), self.faces, self.labels, space, self.job)

    def __repr__(self) -> str:
        return f"<Mesh of {len(self.faces)} triangles and {len(self.vertices)} vertices, mm, {self.space.upper()}>"


def _turned(vertices: Any) -> Any:
    if not isinstance(vertices, memoryview):
        turned = vertices.copy()
        turned[:, :2] *= -1
        return turned
    numbers = array("f", vertices.tobytes())
    for axis in (0, 1):
        numbers[axis::3] = array("f", [-number for number in numbers[axis::3]])
    return memoryview(numbers).cast("B").cast("f", [len(vertices), 3]) if numbers else vertices


def read_ply(source: Union[bytes, bytearray, memoryview, str, Path], job: Optional[Job] = None) -> Mesh:
    """The mesh of a PLY file that isomesh wrote. Raises WrongAnswer for any other file."""
    data = memoryview(Path(source).read_bytes() if isinstance(source, (str, Path)) else source).cast("B")
    elements = _header_of(bytes(data[:_LONGEST_HEADER]))
    label = elements.pop("label", "")
    vertices, faces = int(elements["vertex"]), int(elements["face"])
    begin = int(elements["begin"])
    vertex_bytes, face_bytes = 12 * vertices, (17 if label else 13) * faces
    if len(data) != begin + vertex_bytes + face_bytes:
        raise WrongAnswer("the PLY file has another size than its header tells")
    records = data[begin + vertex_bytes :]
    if bytes(records[:: 17 if label else 13]).strip(b"\x03"):
        raise WrongAnswer("the PLY file has a face that is no triangle")
    return Mesh(
        _shaped(data[begin : begin + vertex_bytes], "f", vertices, 3),
        _shaped(_columns(records, faces, 1, 12), "I", faces, 3),
        _shaped(_columns(records, faces, 13, 4), "i" if label == "int" else "I", faces) if label else None,
        space=job["parameters"].get("space", "lps") if job else "lps",
        job=job,
    )


def _header_of(text: bytes) -> Dict[str, str]:
    """The counts of elements, where the data begins, and the type of the faces' labels."""
    end = text.find(_HEADER_END)
    lines = text[: max(end, 0)].decode("ascii", "replace").splitlines()
    if lines[:2] != ["ply", "format binary_little_endian 1.0"]:
        raise WrongAnswer("not a binary PLY file")
    properties = [line for line in lines if line.startswith("property ")]
    known = [f"property float {axis}" for axis in "xyz"] + ["property list uchar uint vertex_indices"]
    labels = [line.split()[1] for line in properties[4:] if line.split()[2:] == ["label"]]
    counts = dict(line.split()[1:3] for line in lines if line.startswith("element "))
    if properties[:4] != known or len(properties) != 4 + len(labels) or list(counts) != ["vertex", "face"]:
        raise WrongAnswer("not a PLY file of isomesh's")
    return {**counts, "begin": str(end + len(_HEADER_END)), **({"label": labels[0]} if labels else {})}


def _columns(records: memoryview, count: int, begin: int, width: int) -> memoryview:
    """So many bytes from `begin` on of each record, one record's after the other's."""
    size = len(records) // count if count else 1
    out = bytearray(width * count)
    for byte in range(width):
        out[byte::width] = records[begin + byte :: size]
    return memoryview(out)


def _shaped(data: memoryview, kind: str, *shape: int) -> Any:
    """Little-endian bytes as an array of that shape: numpy's, or a memoryview."""
    if sys.byteorder != "little":
        swapped = array(kind, data.tobytes())
        swapped.byteswap()
        data = memoryview(swapped).cast("B")
    try:
        import numpy
    except ImportError:
        pass
    else:
        return numpy.frombuffer(data.tobytes(), numpy.dtype(kind)).reshape(shape).copy()
    # Newer stubs want the kind as a literal.
    view: Any = memoryview(data.tobytes())
    if 0 in shape:  # which a memoryview cannot have
        return view[:0].cast(kind)
    return view.cast(kind, shape)
