"""A mesh on a page of its own: everything is in the page, so it works offline, and in exported notebooks."""

from __future__ import annotations

import base64
import html
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Sequence, Union

from .files import written

if TYPE_CHECKING:
    import os

    from .mesh import Mesh

_MOST_TRIANGLES = 200_000  # a page of about 4 MB
_GRID = 65535
_PLAIN = (214, 205, 190)


class View:
    """A mesh as a notebook shows it; see `isomesh_client.view`."""

    def __init__(self, mesh: Mesh, labels: Optional[Sequence[int]], height: int, triangles: int) -> None:
        self._page = _page(mesh, labels, triangles)
        self._height = int(height)

    def save(self, path: Union[str, os.PathLike[str]]) -> Path:
        """Writes the view as a page of its own, which any browser shows offline."""
        target = Path(path)
        with written(target) as file:
            file.write(self._page.encode())
        return target

    def _repr_html_(self) -> str:
        # A frame of its own: scripts run there in notebooks that do not run those of outputs, and nothing mixes.
        return (
            f'<iframe sandbox="allow-scripts" title="isomesh" srcdoc="{html.escape(self._page)}" '
            f'style="width: 100%; height: {self._height}px; border: 1px solid #ccc"></iframe>'
        )

    def __repr__(self) -> str:
        return f"<View of {len(self._page) / 1e6:.1f} MB; .save('view.html') writes it>"


def view(
    mesh: Mesh, labels: Optional[Sequence[int]] = None, *, height: int = 480, triangles: int = _MOST_TRIANGLES
) -> View:
    """Shows a mesh in a notebook: drag to turn it, use the wheel to come closer, switch labels on and off.

    labels     those to show. Default: all
    height     in pixels
    triangles  about so many are shown at most: larger meshes are shown coarser. 200 000 take about 4 MB of the notebook

    Needs the package numpy and a browser with WebGL 2. The mesh itself stays as it is.
    """
    return View(mesh, labels, height, triangles)


def _page(mesh: Mesh, labels: Optional[Sequence[int]], most: int) -> str:
    text = json.dumps(_content(mesh, labels, most))
    # Nothing in the text may end the script that holds it.
    page = Path(__file__).with_name("viewer.html").read_text("utf-8")
    return page.replace("/*MESH*/", text.replace("<", "\\u003c"), 1)


def _content(mesh: Mesh, labels: Optional[Sequence[int]], most: int) -> Dict[str, Any]:
    import numpy

    vertices, faces = numpy.asarray(mesh.vertices), numpy.asarray(mesh.faces)
    of_faces = numpy.zeros(len(faces), "int64") if mesh.labels is None else numpy.asarray(mesh.labels)
    if labels is not None:
        if mesh.labels is None:
            raise ValueError("this mesh has no labels to choose from")
        missing = sorted({int(each) for each in labels} - set(numpy.unique(of_faces).tolist()))
        if missing:
            raise ValueError(f"the mesh has no label {', '.join(map(str, missing))}")
        chosen = numpy.isin(of_faces, list(labels))
        faces, of_faces = faces[chosen], of_faces[chosen]
    colors = numpy.full((len(vertices), 3), _PLAIN, "uint8") if mesh.colors is None else numpy.asarray(mesh.colors)
    count = len(faces)
    points, faces, cells, used = _coarser(vertices, faces, max(1, most))
    low, high = (points.min(0), points.max(0)) if len(points) else (numpy.zeros(3), numpy.zeros(3))
    step = float((high - low).max()) / _GRID or 1.0
    order = numpy.argsort(of_faces[cells], kind="stable")
    faces, of_faces = faces[order], of_faces[cells][order]
    words = f"{_spaced(count)} triangles, mm, {mesh.space.upper()}"
    if len(faces) < count:
        words += f"; shown with {_spaced(len(faces))}"
    return {
        "positions": _text(numpy.rint((points - low) / step).astype("<u2")),
        "corners": _text(faces.astype("<u4")),
        "colors": _text(colors[used]),
        "low": low.tolist(),
        "high": high.tolist(),
        "step": step,
        "space": mesh.space,
        "groups": _groups(mesh, faces, of_faces, colors[used]),
        "words": words,
    }


def _coarser(vertices: Any, faces: Any, most: int) -> Any:
    """Points, faces of these, which faces of the mesh they were, and a vertex of the mesh for each point. More than `most` faces
    become about so many: the vertices in each cell of a grid become their mean. Only for looking at: a mesh with fewer
    triangles comes from max_error_mm."""
    import numpy

    used, corners = numpy.unique(faces, return_inverse=True)
    corners, points = corners.reshape(-1, 3), vertices[used].astype("float64")
    if len(faces) <= most:
        return points, corners, numpy.arange(len(faces)), used
    low = points.min(0)
    longest = float((points.max(0) - low).max()) or 1.0
    # A surface crosses about as many cells as a grid has in two of its axes.
    cells = max(8.0, 0.4 * most**0.5)
    while True:
        place = ((points - low) * (cells / longest)).astype("int64")
        _, first, joined, sizes = numpy.unique(
            (place[:, 0] * int(cells + 2) + place[:, 1]) * int(cells + 2) + place[:, 2],
            return_index=True, return_inverse=True, return_counts=True,
        )
        ends = numpy.sort(joined[corners], 1)
        whole = numpy.flatnonzero((ends[:, 0] != ends[:, 1]) & (ends[:, 1] != ends[:, 2]))
        a, b, c = ends[whole].T
        kept = whole[numpy.sort(numpy.unique((a * len(first) + b) * len(first) + c, return_index=True)[1])]
        if len(kept) <= most or cells <= 8:
            means = numpy.stack([numpy.bincount(joined, points[:, axis]) / sizes for axis in range(3)], 1)
            return means, joined[corners[kept]], kept, used[first]
        cells = max(8.0, cells * min(0.9, 0.95 * (most / len(kept)) ** 0.5))


def _spaced(number: int) -> str:
    return f"{number:,}".replace(",", "\u202f")


def _groups(mesh: Mesh, faces: Any, of_faces: Any, colors: Any) -> List[Dict[str, Any]]:
    """The faces of each label, which are in its order, with its name and colour."""
    import numpy

    if mesh.labels is None:
        return [{"name": "", "color": "", "first": 0, "count": len(faces)}]
    names = _names(mesh)
    groups = []
    for label, first, count in zip(*(each.tolist() for each in numpy.unique(of_faces, return_index=True, return_counts=True))):
        color = "#" + bytes(colors[faces[first][0]].tolist()).hex()
        groups.append({"name": names.get(label, f"label {label}"), "color": color, "first": first, "count": count})
    return groups


def _names(mesh: Mesh) -> Dict[int, str]:
    try:
        found = mesh.job["mesh"].get("labels", [])
    except AttributeError:
        return {}
    return {each["label"]: name for each in found if (name := each.get("name"))}


def _text(values: Any) -> str:
    return base64.b64encode(values.tobytes()).decode("ascii")
