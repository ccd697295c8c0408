"""A mesh as arrays."""

from __future__ import annotations

import hashlib
import importlib
from array import array
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterator, Optional, Sequence, Union

from . import files, ply, viewer

if TYPE_CHECKING:
    import os

    from . import api

    Download = Callable[..., Path]


class Mesh:
    """A surface of triangles, in millimetres.

    vertices  float32, shape (n, 3)
    faces     uint32, shape (m, 3): indices of vertices, counter-clockwise seen from outside
    labels    int32, uint32 or int64, shape (m,): the label of each face; None unless the job had labels. Each
              label has vertices of its own; where two labels touch, theirs are at the same places
    colors    uint8, shape (n, 3): red, green and blue (sRGB) of each vertex's label; None without labels
    normals   float32, shape (n, 3): the unit normal of each vertex
    bounds    float32, shape (2, 3): the smallest and the largest corner
    space     "lps" (DICOM's patient space), or "ras" (NIfTI's and nibabel's); see `in_space`
    job       the job that made the mesh, with everything that the server measured
    notes     what the server decided or corrected when it read the volume, and then what it found in the mesh,
              as {"code", "detail"}

    The arrays belong to you: change them or assign others, as in `mesh.vertices += 1`. `job` and
    `notes` then still describe the mesh that the server made.

    The arrays are numpy arrays. Without numpy they are read-only memoryviews of the same shapes, and
    `normals` is not available: `vertices[7, 0]`, `len(faces)` and `faces.tolist()` work in both cases.
    """

    vertices: Any
    faces: Any
    labels: Any
    colors: Any
    notes: Sequence[api.Note]

    def __init__(
        self,
        vertices: Any,
        faces: Any,
        labels: Optional[Any] = None,
        space: str = "lps",
        job: Optional[api.SucceededJob] = None,
        notes: Sequence[api.Note] = (),
        download: Optional[Download] = None,
        colors: Optional[Any] = None,
    ) -> None:
        self.vertices = vertices
        self.faces = faces
        self.labels = labels
        self.colors = colors
        self.notes = notes
        self._space = _checked(space)
        self._job = job
        self._download = download

    @property
    def space(self) -> str:
        return self._space

    @property
    def job(self) -> api.SucceededJob:
        if self._job is None:
            raise AttributeError("this mesh has no job: it was not fetched from a server")
        return self._job

    @property
    def bounds(self) -> Any:
        """The smallest and the largest corner, shape (2, 3); zeros for an empty mesh."""
        if not isinstance(self.vertices, memoryview):
            import numpy

            points = numpy.asarray(self.vertices)
            return numpy.stack([points.min(0), points.max(0)]) if len(points) else numpy.zeros((2, 3), "float32")
        numbers = array("f", self.vertices.tobytes()) or array("f", [0, 0, 0])
        corners = [pick(numbers[axis::3]) for pick in (min, max) for axis in range(3)]
        return memoryview(array("f", corners)).cast("B").cast("f", [2, 3])

    @property
    def normals(self) -> Any:
        """The unit normal of each vertex, outward: the mean of its faces, weighted by their areas.

        The normals are computed from `vertices` and `faces` on every access. A normal is zero if the
        vertex has no faces, or if its faces cancel out.
        """
        numpy = _package("numpy", "mesh.normals", "numpy")
        points = numpy.asarray(self.vertices)
        corners = [numpy.asarray(self.faces)[:, corner].astype("intp") for corner in range(3)]
        first = points[corners[0]].astype("float64")
        along, across = points[corners[1]] - first, points[corners[2]] - first
        sums = numpy.zeros((len(points), 3))
        for x, y, z in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            of_faces = along[:, y] * across[:, z] - along[:, z] * across[:, y]
            for corner in corners:
                sums[:, x] += numpy.bincount(corner, of_faces, len(points))
        lengths = numpy.linalg.norm(sums, axis=1, keepdims=True)
        return numpy.divide(sums, lengths, out=numpy.zeros_like(sums), where=lengths > 0).astype("float32")

    def in_space(self, space: str) -> Mesh:
        """A copy of the mesh in "ras" or "lps". x and y change their signs between the two."""
        turned = _turned if _checked(space) != self.space else _copied
        labels, colors = (None if each is None else _copied(each) for each in (self.labels, self.colors))
        return Mesh(
            turned(self.vertices), _copied(self.faces), labels, space, self._job, self.notes, self._download, colors
        )

    def save(self, path: Union[str, os.PathLike[str]]) -> Path:
        """Writes the mesh to a file and returns the file's path. The suffix selects the format.

        `.ply` is written from the arrays. Every other format is a file of the job and is downloaded:
        `client.mesh("head.nii.gz", iso=60, formats=["glb", "stl"])` makes the files for `.glb` and
        `.stl`. An `.obj` of labels gets its materials beside it, as `client.download` says. Raises
        ValueError if the job has no file of the format, or if the mesh is not the one that the server
        made: its arrays were changed, or `in_space` has turned it.
        """
        target = Path(path)
        form = files.format_of(target)
        if form == "ply":
            data = self._in_ply()
            first = next(data)  # raises for arrays that cannot be written, before there is a file
            with files.written(target) as file:
                file.write(first)
                file.writelines(data)
            return target
        if self._job is None:
            raise ValueError("this mesh has no job, so it can be saved as .ply only")
        files.file_of(self._job, form)
        self._expect_unchanged(form)
        if self._download is None:
            raise ValueError("this mesh has no connection to a server; use client.download(mesh.job, path)")
        return self._download(self._job, target, allow_empty=True)  # whoever has an empty mesh has accepted it

    def to_trimesh(self) -> Any:
        """The mesh as a trimesh.Trimesh with the same vertices and faces (int64). Labels become the
        face attribute "label"; metadata says the units and the space. Needs the package trimesh."""
        trimesh = _package("trimesh", "mesh.to_trimesh()", "trimesh")
        numpy = _package("numpy", "mesh.to_trimesh()", "numpy")
        labels = {} if self.labels is None else {"label": numpy.array(self.labels)}
        is_angstrom = any(note["code"] == "unit-angstrom" for note in self.notes)
        return trimesh.Trimesh(
            vertices=numpy.array(self.vertices, "float64"),
            faces=numpy.array(self.faces, "int64"),
            vertex_colors=None if self.colors is None else numpy.array(self.colors),
            face_attributes=labels,
            metadata={"units": "angstrom" if is_angstrom else "mm", "space": self.space},
            process=False,  # which would merge and reorder vertices
        )

    def to_vtk(self) -> Any:
        """The mesh as a vtkPolyData with the same points (float32) and cells (int64). Labels become
        the cell data "label". The arrays are copied. Needs the package vtk."""
        numpy = _package("numpy", "mesh.to_vtk()", "numpy")
        package = "vtk (on Debian: apt install python3-vtk9)"
        core = _package("vtkmodules.vtkCommonCore", "mesh.to_vtk()", package)
        model = _package("vtkmodules.vtkCommonDataModel", "mesh.to_vtk()", package)
        support = _package("vtkmodules.util.numpy_support", "mesh.to_vtk()", package)

        points = core.vtkPoints()
        points.SetData(support.numpy_to_vtk(numpy.ascontiguousarray(self.vertices, "float32"), deep=True))
        ends = numpy.arange(0, 3 * len(self.faces) + 1, 3, "int64")
        corners = numpy.ravel(self.faces).astype("int64")
        cells = model.vtkCellArray()
        cells.SetData(*(support.numpy_to_vtkIdTypeArray(each, deep=True) for each in (ends, corners)))
        surface = model.vtkPolyData()
        surface.SetPoints(points)
        surface.SetPolys(cells)
        if self.labels is not None:
            labels = support.numpy_to_vtk(numpy.ascontiguousarray(self.labels), deep=True)
            labels.SetName("label")
            surface.GetCellData().SetScalars(labels)
        return surface

    def to_pyvista(self) -> Any:
        """The mesh as a pyvista.PolyData, as `to_vtk` describes it. Needs the package pyvista."""
        return _package("pyvista", "mesh.to_pyvista()", "pyvista").wrap(self.to_vtk())

    def to_meshio(self) -> Any:
        """The mesh as a meshio.Mesh of triangles, which it writes to its formats: `mesh.to_meshio().write("head.vtu")`.
        Labels become the cell data "label". The arrays are copied. Needs the package meshio."""
        meshio = _package("meshio", "mesh.to_meshio()", "meshio")
        numpy = _package("numpy", "mesh.to_meshio()", "numpy")
        labels = {} if self.labels is None else {"label": [numpy.array(self.labels)]}
        corners = numpy.array(self.faces, "int64")
        return meshio.Mesh(numpy.array(self.vertices), [("triangle", corners)], cell_data=labels)

    def _repr_html_(self) -> Optional[str]:
        """The mesh as a notebook shows it; see `isomesh_client.view`. None, so that `repr` is shown, without numpy and for
        an empty mesh."""
        if isinstance(self.vertices, memoryview) or not len(self.faces):
            return None
        return viewer.view(self)._repr_html_()

    def __repr__(self) -> str:
        return f"<Mesh of {len(self.faces)} triangles and {len(self.vertices)} vertices, mm, {self.space.upper()}>"

    def __getstate__(self) -> Dict[str, Any]:
        # A connection and its token belong to this process; copies of the mesh do without.
        return {**self.__dict__, "_download": None}

    def _in_ply(self) -> Iterator[bytes]:
        return ply.pieces(self.vertices, self.faces, self.labels, self.colors, self.space)

    def _expect_unchanged(self, form: str) -> None:
        """Raises ValueError unless the arrays are those that the server sent."""
        made_in = self.job["parameters"].get("space", "lps")
        if self.space != made_in:
            raise ValueError(
                f"the mesh is in {self.space.upper()}, and the server's .{form} file in {made_in.upper()}: "
                f"add space={self.space!r} to the call that starts the job, or save the mesh as .ply"
            )
        digest = hashlib.sha256()
        for piece in self._in_ply():
            digest.update(piece)
        if digest.hexdigest() != files.file_of(self.job, "ply")["sha256"]:
            raise ValueError(
                f"the mesh was changed, and the server's .{form} file was not: save the mesh as .ply, "
                "or download the server's file with client.download(mesh.job, path)"
            )


def read_ply(source: Union[bytes, bytearray, memoryview, str, os.PathLike[str]]) -> Mesh:
    """The mesh of a PLY file that isomesh wrote. Raises WrongAnswer for any other file."""
    data = source if isinstance(source, (bytes, bytearray, memoryview)) else Path(source).read_bytes()
    return Mesh(**ply.parse(data))


def _checked(space: str) -> str:
    if space not in ("ras", "lps"):
        raise ValueError(f"space must be 'ras' or 'lps', not {space!r}")
    return space


def _package(name: str, what: str, package: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"{what} needs the package {package}; install it with pip install {package.split()[0]}") from error


def _copied(values: Any) -> Any:
    if isinstance(values, memoryview):  # which is read-only
        return values
    import numpy

    return numpy.array(values)


def _turned(vertices: Any) -> Any:
    if not isinstance(vertices, memoryview):
        turned = _copied(vertices)
        turned[:, :2] *= -1
        return turned
    numbers = array("f", vertices.tobytes())
    for axis in (0, 1):
        numbers[axis::3] = array("f", [-number for number in numbers[axis::3]])
    return memoryview(numbers).cast("B").cast("f", [len(vertices), 3]) if numbers else vertices
