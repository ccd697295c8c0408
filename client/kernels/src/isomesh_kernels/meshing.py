"""From an array to a mesh."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Callable, List, Optional, Sequence, Tuple

import numpy
from isomesh_client import Mesh, Raw
from isomesh_client.errors import warn_of_notes
from isomesh_client.files import expect_surface
from isomesh_client.parameters import OMITTED, as_plain, by_keywords, given
from isomesh_client.uploads import described

from .library import Run, in_order, physical_bytes

if TYPE_CHECKING:
    from isomesh_client import api

    Progress = Callable[[float], object]

_NO_VOLUME = "0" * 64  # the parser of requests wants one


@by_keywords
def mesh(
    array: Any,
    *,
    affine: Optional[Any] = None,
    affine_space: str = "ras",
    spacing: Optional[Sequence[float]] = None,
    axes: str = "xyz",
    modality: str = "",
    memory_bytes: Optional[int] = None,
    progress: Optional[Progress] = None,
    allow_empty: bool = False,
    # `generate` writes these lines: the parameters of a mesh.
    iso: api.Iso = OMITTED, inside: api.Inside = OMITTED, labels: api.Labels = OMITTED,
    background: api.Background = OMITTED, label_names: api.LabelNames = OMITTED,
    label_colors: api.LabelColors = OMITTED, label_values: api.LabelValues = OMITTED, scheme: api.Scheme = OMITTED,
    interpolation: api.Interpolation = OMITTED, regularize: api.Regularize = OMITTED, passes: api.Passes = OMITTED,
    smoothing: api.Smoothing = OMITTED, lambda_: api.Lambda = OMITTED, pass_band: api.PassBand = OMITTED,
    max_displacement_mm: api.MaxDisplacement = OMITTED, untangle: api.Untangle = OMITTED,
    close: api.Close = OMITTED, components: api.JobParametersComponents = OMITTED,
    fill_cavities: api.FillCavities = OMITTED, crop: api.Crop = OMITTED, max_error_mm: api.MaxError = OMITTED,
    triangles: api.Triangles = OMITTED,
    # End of the parameters.
) -> Mesh:
    """Makes a mesh of an array in this process: `isomesh_kernels.mesh(scan, affine=image.affine, iso=60)`.

    array     numpy array of three axes: integers, bool, or floats of 16, 32 or 64 bits. It must not change
              meanwhile
    affine    4 x 4 matrix that maps indices (x, y, z) to millimetres. Default: the identity
    affine_space  the space of `affine`: "ras" (nibabel, NIfTI) or "lps" (DICOM, ITK)
    spacing   instead of `affine`: millimetres between samples along x, y and z
    axes      the order of the array's axes: "xyz" (nibabel), or "zyx" (SimpleITK, scikit-image). `affine` and
              `spacing` are in the order x, y, z in both cases
    modality  "ct" says that samples are Hounsfield units; then there are iso-values with names: iso="bone"
    memory_bytes  the most that may be taken beside the array. Default: the memory of the machine
    progress  a function that is called with the share that is done, 0 to 1, up to 20 times a second
    allow_empty  True returns a mesh without vertices and faces if the surface is empty, instead of raising

    All other keywords are parameters of the API; `help(isomesh_client.api.JobOptions)` describes them. Lengths are
    millimetres. `iso` or `labels` is required; iso="otsu" is Otsu's threshold.

    The mesh has `vertices`, float32 (n, 3), millimetres in LPS (`in_space("ras")` turns them); `faces`, uint32 (m, 3),
    counter-clockwise seen from outside; with `labels`, also `labels` of the faces (m,) and `colors`, uint8 (n, 3). The
    numbers are those of the service for the same parameters. `mesh.job["mesh"]` has what was measured.

    Samples are meshed in the order in which a server stores them: indices grow towards the patient's left, back and
    head, as nearly as the directions allow. So the mesh does not depend on the order of the array's axes. They are read
    where they are if they have that order, its first index varies fastest, they have no gaps, and their type is one of
    uint8, int8, uint16, int16, uint32, int32, float32, float64 in the machine's byte order: without `affine`, a
    Fortran-ordered array, or a C-ordered one with axes="zyx". Any other array is copied once; a note in `mesh.notes`
    says so.

    Other threads of Python run meanwhile. An interrupt (Ctrl-C), and an exception of `progress`, ends the work at once.

    Raises ValueError for wrong arguments and samples, TypeError for types, and MemoryError if the mesh would take more
    memory than allowed, with the sentences of the service. Raises isomesh_client.EmptySurface if there is no surface.
    """
    parameters = given(locals())
    samples, raw, notes, left_out = _prepared(array, affine, affine_space, spacing, axes)
    if modality not in ("", "ct"):
        raise ValueError(f"modality must be 'ct' or empty, not {modality!r}")
    request = json.loads(json.dumps({"volume": _NO_VOLUME, **parameters}, default=as_plain))
    limit = physical_bytes() if memory_bytes is None else int(memory_bytes)
    run = Run(samples, raw, left_out, modality == "ct", limit, request)
    made = run.wait(progress)
    if made.error is not None:
        raise _error_of(made.kind.decode(), made.error.decode())
    job: Any = json.loads(made.job)
    done = _mesh_of(run, made, job, notes)
    warn_of_notes([each for each in notes if each["code"] != "copied"], "the array")
    expect_surface(job, allow_empty)
    warn_of_notes(job["mesh"].get("notes", []), "the mesh")
    return done


def _prepared(
    array: Any, affine: Any, space: str, spacing: Any, axes: str
) -> Tuple[Any, Raw, List[Any], int]:
    """The samples as the kernels take them: x fastest, without gaps; also notes, and how many samples were replaced."""
    if axes not in ("xyz", "zyx"):
        raise ValueError(f"axes must be 'xyz' or 'zyx', not {axes!r}")
    if not hasattr(array, "__array__"):
        raise TypeError(f"cannot mesh a {type(array).__name__}: give a numpy array")
    given_array = numpy.asanyarray(array)
    samples, target, raw = described(given_array.T if axes == "zyx" else given_array, affine, space, spacing)
    samples, raw = in_order(numpy.asarray(samples), raw)
    if samples.dtype == bool:
        samples = samples.view("uint8")
    notes: List[Any] = []
    if samples.dtype != target or not samples.flags.f_contiguous or not samples.flags.aligned:
        wanted = "" if samples.dtype == target else f" as {target}"
        notes.append({"code": "copied", "detail": f"The samples were copied{wanted}, with their first index fastest."})
        samples = numpy.array(samples, target, order="F")
    left_out = 0
    if target.kind == "f":
        samples, left_out = _finite(samples, notes)
    return samples, raw, notes, left_out


def _finite(samples: Any, notes: List[Any]) -> Tuple[Any, int]:
    """Samples that are not finite become the smallest one, as on the server. The array itself stays as it is."""
    if numpy.isfinite(samples.min()) and numpy.isfinite(samples.max()):  # NaN is the extreme of an array that has one
        return samples, 0
    finite = numpy.isfinite(samples)
    count = samples.size - int(numpy.count_nonzero(finite))
    text = f"{count} of the {samples.size} samples are not finite numbers"
    if count == samples.size:
        raise ValueError(f"{text}.")
    text += ". At iso-values above the smallest sample they lie outside the surface, or inside it with inside=below."
    notes.append({"code": "non-finite-samples", "detail": text})
    return numpy.asfortranarray(numpy.where(finite, samples, samples[finite].min())), count


def _mesh_of(run: Run, made: Any, job: Any, notes: List[Any]) -> Mesh:
    points, faces = made.vertex_count, made.triangle_count
    labels = colors = None
    if made.labels or job["parameters"].get("labels") is not None:
        labels = _narrow(run.array(made.labels, faces, "int64", 1))
        colors = run.array(made.colors, points, "uint8", 3)
    job["parameters"].pop("volume", None)
    if job["mesh"].get("certificate"):
        # The rest is measured on files. What is proven holds for the arrays as well.
        of_files = job["mesh"]["certificate"]
        proven = ("reference", "proven", "bound_mm", "why_unproven")
        job["mesh"]["certificate"] = {name: of_files[name] for name in proven if name in of_files}
    vertices = run.array(made.vertices, points, "float32", 3)
    notes = [*notes, *job["mesh"].get("notes", [])]
    return Mesh(vertices, run.array(made.triangles, faces, "uint32", 3), labels, "lps", job, notes, None, colors)


def _narrow(labels: Any) -> Any:
    """The type that labels of the service have: int32, or uint32 or int64 if they need it."""
    low, high = (int(labels.min()), int(labels.max())) if len(labels) else (0, 0)
    for name in ("int32", "uint32"):
        limits: Any = numpy.iinfo(name)
        if limits.min <= low and high <= limits.max:
            return labels.astype(name)
    return labels


def _error_of(kind: str, sentence: str) -> Exception:
    if kind == "too-large":
        return MemoryError(sentence)
    if kind in ("invalid-parameter", "unusable-volume"):
        return ValueError(sentence)
    return RuntimeError(sentence)
