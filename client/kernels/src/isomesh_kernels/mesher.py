"""Meshes of all labels, one at a time: the shape of zmesh's Mesher, so that a program changes its import."""

from __future__ import annotations

from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy
from isomesh_client import Mesh

from .meshing import mesh


class LabelMesh(Mesh):
    """The mesh of one label, in the unit of the resolution and along the axes of the array. Its normals are computed from
    the arrays on every access."""

    def triangles(self) -> Any:
        """The corners of each face, float32 (m, 3, 3)."""
        return self.vertices[self.faces]

    def to_ply(self) -> bytes:
        return b"".join(self._in_ply())

    def to_obj(self) -> bytes:
        points = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in self.vertices.tolist())
        corners = "".join(f"f {a} {b} {c}\n" for a, b, c in (self.faces + numpy.uint32(1)).tolist())
        return (points + corners).encode()

    def to_precomputed(self) -> bytes:
        """Neuroglancer's single-resolution format, whose unit is the nanometre: give the resolution in that."""
        count = numpy.array([len(self.vertices)], "<u4")
        return b"".join(each.tobytes() for each in (count, self.vertices.astype("<f4"), self.faces.astype("<u4")))


class Mesher:
    """Labels become meshes in two steps: `mesh` makes all of them, `get` returns one.

    resolution  the lengths of a voxel along x, y and z, in any unit. Vertices are in the same unit, along the array's
                axes: voxel (i, j, k) lies at (i, j, k) * resolution

        mesher = Mesher((4, 4, 40))
        mesher.mesh(labels)
        for label in mesher.ids():
            surface = mesher.get(label)
            mesher.erase(label)

    Labels are smoothed, unless `mesh` is called with passes=0. Where two labels touch, their meshes have the same
    vertices, also after simplification.
    """

    def __init__(self, resolution: Sequence[float]) -> None:
        self.resolution = numpy.array([float(step) for step in resolution], "float32")
        if len(self.resolution) != 3:
            raise ValueError(f"resolution must be three numbers, not {resolution!r}")
        self.clear()

    def __repr__(self) -> str:
        return f"<Mesher of {len(self._faces)} labels>"

    def clear(self) -> None:
        """Forgets everything but the resolution."""
        self._labels: Any = None
        self._values: Any = None  # the labels themselves, if the kernels have numbers instead
        self._parameters: Dict[str, Any] = {}
        self._faces: Dict[int, int] = {}  # the label's number in the kernels
        self._made: Dict[Tuple[float, float], Mesh] = {}

    def mesh(self, data: Any, close: bool = False, preserve_order: bool = True, **parameters: Any) -> None:
        """Makes a mesh of each label in `data`, an array of integers (x, y, z), which must not change as long as `get`
        simplifies. 0 is the background.

        `close` caps labels at the array's border. `preserve_order` has no effect: the order is always the same.
        `parameters` are those of `isomesh_kernels.mesh`, such as passes=0.
        """
        self.clear()
        labels = numpy.asarray(data)
        if labels.dtype.kind not in "iub":
            raise TypeError(f"labels are integers, not {labels.dtype}")
        if not labels.any():
            return
        if labels.dtype.itemsize == 8 and not -(2**31) <= int(labels.min()) <= int(labels.max()) < 2**31:
            self._values, places = numpy.unique(numpy.append(labels.reshape(-1), labels.dtype.type(0)), return_inverse=True)
            zero = int(numpy.searchsorted(self._values, 0))
            places = places[:-1].reshape(labels.shape)
            # 0 stays the background: the values below it move up by one.
            labels = numpy.where(places == zero, 0, places + (places < zero)).astype("uint32", order="F")
            self._values = numpy.concatenate([self._values[zero : zero + 1], self._values[:zero], self._values[zero + 1 :]])
        self._labels = labels
        self._parameters = {**parameters, "labels": "all", "close": close, "spacing": self.resolution.tolist()}
        made = self._simplified(0, 0.0)
        for number in numpy.unique(made.labels).tolist():
            self._faces[number if self._values is None else int(self._values[number])] = number

    def ids(self) -> List[int]:
        """The labels that have a mesh, ascending."""
        return sorted(self._faces)

    def get(
        self,
        label: int,
        normals: bool = False,
        reduction_factor: float = 0,
        max_error: Optional[float] = None,
        voxel_centered: bool = False,
    ) -> LabelMesh:
        """The mesh of a label.

        normals           has no effect: a mesh always has `normals`
        reduction_factor  simplifies: divides the number of triangles by this factor, if `max_error` allows; 0: does not.
                          The first call with other numbers simplifies all labels, so that walls fit each other
        max_error         the largest error, in the unit of the resolution. Default: the shortest side of a voxel
        voxel_centered    moves the mesh by half a voxel: voxel (0, 0, 0) then begins at 0
        """
        if label not in self._faces:
            raise KeyError(f"there is no mesh of the label {label}; ids() has the labels")
        error = float(self.resolution.min()) if max_error is None else float(max_error)
        made = self._simplified(reduction_factor, error if reduction_factor else 0.0)
        # Labels are ascending, and each has vertices of its own, in the same order.
        places: Any = numpy.searchsorted(made.labels, [self._faces[label], self._faces[label] + 1])
        faces = made.faces[slice(*places)]
        first, last = (int(faces.min()), int(faces.max()) + 1) if len(faces) else (0, 0)
        vertices = made.vertices[first:last] + (self.resolution / 2 if voxel_centered else numpy.float32(0))
        return LabelMesh(vertices, faces - numpy.uint32(first))

    def erase(self, label: int) -> None:
        """Forgets the mesh of a label. The memory is given back with the last one."""
        self._faces.pop(label, None)
        if not self._faces:
            self.clear()

    def _simplified(self, factor: float, error: float) -> Mesh:
        key = (float(factor), error)
        if key not in self._made:
            fewer: Dict[str, Any] = {}
            if factor:
                whole = len(self._made[(0.0, 0.0)].faces)
                fewer = {"triangles": max(1, int(whole / factor)), "max_error_mm": error}
            self._made[key] = mesh(self._labels, **{**self._parameters, **fewer})
        return self._made[key]
