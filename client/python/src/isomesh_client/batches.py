"""Many volumes at once."""

from __future__ import annotations

import copy
import importlib
import os
import re
import sys
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterable, Iterator, List, Mapping, Optional, Sequence, Tuple, Union

from . import api, uploads
from .files import files_of_mesh, format_of
from .parameters import OMITTED, by_keywords, given
from .stopping import Stop

if TYPE_CHECKING:
    from .mesh import Mesh

    Target = Union[str, os.PathLike[str], Callable[[Any], Union[str, os.PathLike[str]]]]

_LONGEST_WAIT = 0.5  # seconds
_PACKED = (".gz", ".bz2", ".xz", ".zip", ".tar", ".tgz")


@dataclass(frozen=True)
class Result:
    """What became of one source of `Client.mesh_all`. True unless it failed.

    source   the source itself
    mesh     the mesh, if `to` was not given
    path     the file, if `to` was given
    job      the succeeded job
    skipped  True if the file was there already
    error    the exception; all of the above but `source` and `path` are None or False then
    """

    source: Any
    mesh: Optional[Mesh] = None
    path: Optional[Path] = None
    job: Optional[api.SucceededJob] = None
    skipped: bool = False
    error: Optional[Exception] = None

    def __bool__(self) -> bool:
        return self.error is None

    def __repr__(self) -> str:
        name = _name_of(self.source)[1]
        if self.error is not None:
            return f"<Result of {name}: {type(self.error).__name__}: {self.error}>"
        if self.skipped:
            return f"<Result of {name}: {self.path} was there>"
        return f"<Result of {name}: {self.path or self.mesh}>"


class Batches:
    """The part of Client that meshes many volumes."""

    @by_keywords
    def mesh_all(
        self,
        sources: Iterable[Any],
        *,
        to: Optional[Target] = None,
        workers: int = 4,
        skip_existing: bool = False,
        progress: Union[bool, Callable[[Result], object]] = False,
        allow_empty: bool = False,
        spacing: Optional[Sequence[float]] = None,
        accept: Sequence[str] = (),
        masks: bool = False,
        nifti_form: str = "",
        modality: str = "",
        # `generate` writes these lines: the parameters of a job.
        iso: api.Iso = OMITTED, inside: api.Inside = OMITTED, labels: api.Labels = OMITTED,
        background: api.Background = OMITTED, label_names: api.LabelNames = OMITTED,
        label_colors: api.LabelColors = OMITTED, label_values: api.LabelValues = OMITTED, scheme: api.Scheme = OMITTED,
        interpolation: api.Interpolation = OMITTED, regularize: api.Regularize = OMITTED, passes: api.Passes = OMITTED,
        smoothing: api.Smoothing = OMITTED, lambda_: api.Lambda = OMITTED, pass_band: api.PassBand = OMITTED,
        max_displacement_mm: api.MaxDisplacement = OMITTED, untangle: api.Untangle = OMITTED,
        close: api.Close = OMITTED, components: api.JobParametersComponents = OMITTED,
        fill_cavities: api.FillCavities = OMITTED, crop: api.Crop = OMITTED, max_error_mm: api.MaxError = OMITTED,
        triangles: api.Triangles = OMITTED, formats: Sequence[api.MeshFormat] = OMITTED,
        draco: api.JobParametersDraco = OMITTED, normals: api.Normals = OMITTED, distances: api.Distances = OMITTED,
        lods: api.Lods = OMITTED, merge: api.Merge = OMITTED, glb_codec: api.GlbCodec = OMITTED,
        space: api.Space = OMITTED, priority: api.Priority = OMITTED, certify: api.Certify = OMITTED,
        min_thickness_mm: api.MinThickness = OMITTED, callback: api.Callback = OMITTED,
        # End of the parameters.
    ) -> List[Result]:
        """Meshes many volumes: `client.mesh_all(Path("scans").glob("*.nii.gz"), to="meshes/{name}.glb", iso=60)`.

        sources   everything that `mesh` takes, one after the other
        to        the file of each mesh: a pattern with `{name}`, the name of a file or folder without the suffixes of
                  volumes, `{file}`, with them, and `{folder}`, the name of the folder that it is in; or a function that
                  returns the path for a source. The suffix selects the format. Folders are made. Without `to`, the meshes
                  are in the results, and so in memory
        workers   so many volumes are uploaded or meshed at a time
        skip_existing  leaves out sources whose file is there, so that the same call resumes a batch: files appear whole
        progress  True shows a bar on standard error, tqdm's if that is installed; or a function that is called with each
                  result as it comes, in this thread

        All other keywords are as for `mesh`, and hold for all volumes. Returns a result for each source, in their
        order. What fails is in `result.error`, and the others go on: `[each for each in results if not each]` are the
        failures. Raises ValueError before anything is sent if two sources would have the same file, or a mesh would
        replace a source. An interrupt ends uploads and waits, and cancels the jobs; what is finished by then is on disk.
        """
        keywords = locals()
        parameters = given(keywords)
        of_upload = {each: keywords[each] for each in ("accept", "masks", "nifti_form", "modality") if keywords[each]}
        if spacing is not None:
            of_upload["spacing"] = spacing
        if isinstance(sources, (str, bytes, os.PathLike)):
            raise TypeError(f"sources must be a list, for example [{sources!r}]")
        if workers < 1:
            raise ValueError(f"workers must be at least 1, not {workers}")
        if skip_existing and to is None:
            raise ValueError("skip_existing needs to=, the files that may be there")
        if to is not None and "formats" in parameters:
            raise ValueError("the suffix in to= selects the format, so formats is not for it")
        sources = list(sources)
        work = [(source, None if to is None else _target_of(source, to)) for source in sources]
        is_by_labels = parameters.get("labels") is not None or (masks and "iso" not in parameters)
        files = [[] if path is None else files_of_mesh(path, is_by_labels) for _, path in work]

        def is_skipped(each: Sequence[Path]) -> bool:
            return skip_existing and all(os.path.exists(file) for file in each)

        _expect_distinct(sources, files, is_skipped)
        stop = Stop()
        client: Any = copy.copy(self)
        client._exchange = client._exchange.until(stop)

        def one(source: Any, path: Optional[Path], own: Sequence[Path]) -> Result:
            stop.check()
            if is_skipped(own):  # another process may work on the same sources
                return Result(source, path=path, skipped=True)
            try:
                if path is None:
                    mesh = client.mesh(source, allow_empty=allow_empty, **of_upload, **parameters)
                    return Result(source, mesh=mesh, job=mesh.job)
                path.parent.mkdir(parents=True, exist_ok=True)
                wanted = {**parameters, "formats": [format_of(path)]}
                _, job = client._made(source, of_upload, wanted, None)
                client.download(job, path, allow_empty=allow_empty)
                return Result(source, path=path, job=job)
            except Exception as error:
                return Result(source, path=path, error=error)

        with ThreadPoolExecutor(workers) as pool:
            try:
                futures = [pool.submit(one, *each, own) for each, own in zip(work, files)]
                _tell(futures, progress)
            except BaseException:
                stop.set()
                raise
        return [future.result() for future in futures]


def _name_of(source: Any) -> Tuple[str, str, str]:
    """{name}, {file} and {folder} of a source."""
    if isinstance(source, (list, tuple)) and source:
        source = source[0]
    if isinstance(source, Mapping):
        found = _plain(str(source.get("name") or str(source.get("id", ""))[:12]))
        return found, found, ""
    if not isinstance(source, (str, os.PathLike)):
        return "", type(source).__name__, ""
    path = Path(os.path.abspath(source))
    name = path.name
    while name != (unpacked := _without(_PACKED, name)):
        name = unpacked
    return _without(api.VOLUME_SUFFIXES, name), path.name, path.parent.name


def _without(suffixes: Sequence[str], name: str) -> str:
    """The name without the suffix of these that it has, if more than that remains."""
    found = next((each for each in suffixes if name.lower().endswith(each.lower()) and len(name) > len(each)), "")
    return name[: len(name) - len(found)]


def _plain(name: str) -> str:
    """A volume's name, which anybody may have given, as that of a file that stays in its folder."""
    text = re.sub(r"[\0-\x1f\x7f-\x9f]", "\ufffd", re.sub(r"[/\\]", "_", name))
    return "_" * len(text) if text in (".", "..") else text


def _target_of(source: Any, to: Target) -> Path:
    if callable(to):
        return Path(to(source))
    name, file, folder = _name_of(source)
    if not name:
        raise ValueError(f"a source of type {type(source).__name__} has no name for to=; give a function that returns its path")
    try:
        found = Path(os.fspath(to).format(name=name, file=file, folder=folder))
    except (KeyError, IndexError) as error:
        raise ValueError(f"to= knows {{name}}, {{file}} and {{folder}}, not {{{error.args[0]}}}") from error
    format_of(found)
    return found


def _expect_distinct(
    sources: Sequence[Any], files: Sequence[Sequence[Path]], is_skipped: Callable[[Sequence[Path]], bool]
) -> None:
    """Raises ValueError if a mesh would replace a source, or a file of another mesh. `files` are those of each mesh."""
    sent = {_id_of(file) for source in sources for file in uploads.files_of(source)} - {None} if any(files) else set()
    seen: Dict[str, Any] = {}
    for source, each in zip(sources, files):
        for file in each:
            if _id_of(file) in sent and not is_skipped(each):
                raise ValueError(f"the mesh of {source} would replace {file}, which is a file of a source; use another to=")
            # A link is replaced itself, and its folder may have several names.
            key = os.path.join(_real(file.parent), file.name)
            if key in seen:
                raise ValueError(f"{seen[key]} and {source} would have the same file, {file}; use {{folder}} in to=, or a function")
            seen[key] = source


def _real(folder: Path) -> str:
    """The folder without links."""
    try:
        return os.path.realpath(folder)
    except ValueError:  # a name that no folder can have
        return str(folder)


def _id_of(file: Path) -> Optional[Tuple[int, int]]:
    """The same for all names of a file; None if there is none."""
    try:
        found = os.stat(file)
    except (OSError, ValueError):  # ValueError: a name that no file can have
        return None
    return found.st_dev, found.st_ino


def _tell(futures: Sequence[Future[Result]], progress: Union[bool, Callable[[Result], object]]) -> None:
    """Waits for all results."""
    arriving: Any = _arriving(futures)
    if callable(progress):
        for future in arriving:
            progress(future.result())
        return
    if progress:
        try:
            bar = importlib.import_module("tqdm.auto").tqdm
        except ImportError:
            arriving = _counted(arriving, len(futures))
        else:
            arriving = bar(arriving, total=len(futures), unit="mesh")
    for _ in arriving:
        pass


def _arriving(futures: Sequence[Future[Result]]) -> Iterator[Future[Result]]:
    """The futures as they end."""
    waiting = set(futures)
    while waiting:
        # Python may not notice an interrupt that comes as a wait begins, until that wait ends.
        done, waiting = wait(waiting, _LONGEST_WAIT, FIRST_COMPLETED)
        yield from done


def _counted(arriving: Any, total: int) -> Any:
    for count, each in enumerate(arriving, start=1):
        print(f"\r{count} of {total}", end="" if count < total else "\n", file=sys.stderr, flush=True)
        yield each
