"""A client of an isomesh server."""

from __future__ import annotations

import contextlib
import copy
import os
import re
import time
import uuid
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterable, Iterator, List, Mapping, Optional, Sequence, Tuple, Union, cast
from urllib.parse import urlencode

from . import answers, busy, ply, uploads
from .batches import Batches
from .errors import IsomeshError, JobFailed, Refused, Unreachable, warn_of_notes
from .exchange import Exchange
from .files import FINAL_STATES, Arriving, expect_surface, file_of, files_of_mesh, format_of, written
from .mesh import Mesh
from .parameters import OMITTED, as_query, by_keywords, given
from .paths import id_of as _id_of
from .paths import job_path as _job_path
from .paths import volume_path as _volume_path
from .transport import Transport

if TYPE_CHECKING:
    from . import api
    from .files import AnyJob
    from .uploads import Raw

    Source = Union[str, os.PathLike[str], Sequence[Union[str, os.PathLike[str]]], bytes, bytearray, memoryview, Any]
    Progress = Callable[[api.Job], None]

_LONGEST_WAIT = 30.0  # seconds, the server's
_SHORTEST_LOOK = 0.2
_LOOKS_LIKE_LABELS = "looks-like-labels"


class Client(Batches):
    """A client of one server. It is constant after construction: several threads may share it.

    server       http://HOST:PORT, https://HOST:PORT or unix:PATH. Default: ISOMESH_SERVER of the
                 environment, or http://127.0.0.1:8080
    token        the bearer token, if the server needs one. Default: ISOMESH_TOKEN
    authorities  a file of trusted certificate authorities. Default: ISOMESH_CA, or the system's
    timeout      the longest silence of the server, in seconds
    retry_seconds  how long a request waits for a busy server, in seconds; 0: not at all

    A method that takes a volume or a job takes its id, or the dict that another method returned.

    Methods raise Refused if the server rejects the request, Unreachable if no response arrives,
    WrongAnswer if a response does not follow the API, and ValueError or TypeError for wrong arguments.
    If a connection breaks, safe requests are repeated: reading, and submitting a job. Uploads of
    8 MiB or more resume where they broke; they fail after a minute without progress. If the server is
    busy (429 or 503), every request waits as the server's Retry-After says, and is sent again.
    """

    def __init__(
        self,
        server: Optional[str] = None,
        *,
        token: Optional[str] = None,
        authorities: Optional[str] = None,
        timeout: float = 300,
        retry_seconds: float = 600,
    ) -> None:
        environment = os.environ.get
        self.server = server or environment("ISOMESH_SERVER") or "http://127.0.0.1:8080"
        token = token if token is not None else environment("ISOMESH_TOKEN", "")
        authorities = authorities or environment("ISOMESH_CA") or None
        self._exchange = Exchange(Transport(self.server, token, authorities, timeout, retry_seconds))

    def __repr__(self) -> str:
        return f"<Client of {self.server}>"

    @by_keywords
    def mesh(
        self,
        source: Source,
        *,
        affine: Optional[Any] = None,
        affine_space: str = "ras",
        spacing: Optional[Sequence[float]] = None,
        raw: Optional[Raw] = None,
        name: str = "",
        series: str = "",
        member: str = "",
        masks: bool = False,
        volume: Optional[int] = None,
        accept: Sequence[str] = (),
        nifti_form: str = "",
        modality: str = "",
        progress: Optional[Progress] = None,
        allow_empty: bool = False,
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
    ) -> Mesh:
        """Makes a mesh of a volume in one call: `client.mesh("head.nii.gz", iso=60)`.

        source    everything that `upload` takes, or a stored volume: its id or its dict
        progress  a function that is called with the job about once a second
        allow_empty  True returns a mesh without vertices and faces if the surface is empty, instead of raising

        `affine` to `modality` are as for `upload`. All other keywords are parameters of the job;
        `help(isomesh_client.api.JobOptions)` describes them. `formats` names the files that `mesh.save` needs
        besides `.ply`.

        Vertices are in LPS, unless `space="ras"` is given; `mesh.in_space` converts them. The notes on the volume
        and on the mesh are in `mesh.notes`, and each of them gives a VolumeWarning. Raises JobFailed if the job
        fails, and EmptySurface if there is no surface. An interrupt (Ctrl-C) cancels the job.
        """
        keywords = locals()
        parameters = given(keywords)
        of_upload = {each: keywords[each] for each in _UPLOAD_KEYWORDS if not _is_empty(each, keywords[each])}
        if affine_space != "ras":
            of_upload["affine_space"] = affine_space
        formats = parameters.get("formats", [])
        parameters["formats"] = formats if "ply" in formats else [*formats, "ply"]
        stored, done = self._made(source, of_upload, parameters, progress)
        expect_surface(done, allow_empty)
        return self._fetch(done, stored["notes"])

    # --- Volumes ---------------------------------------------------------------------------------

    def upload(
        self,
        source: Source,
        *,
        affine: Optional[Any] = None,
        affine_space: str = "ras",
        spacing: Optional[Sequence[float]] = None,
        raw: Optional[Raw] = None,
        name: str = "",
        series: str = "",
        member: str = "",
        masks: bool = False,
        volume: Optional[int] = None,
        accept: Sequence[str] = (),
        nifti_form: str = "",
        modality: str = "",
    ) -> api.Volume:
        """Stores a volume and returns the server's description of it. The same upload
        gets the same id.

        source    one of: a path of a file, of a folder of DICOM slices, or of a header with its data
                  beside it; a list of paths that belong together; the bytes of a file; a numpy array
                  with the axes x, y and z; a nibabel image, or any object with `dataobj` and `affine`
        affine    for an array: the 4 x 4 matrix that maps its indices to millimetres
        affine_space  the space of `affine`: "ras" (nibabel, NIfTI) or "lps" (DICOM, ITK)
        spacing   for an array, instead of `affine`, and for a file that gives none: millimetres between
                  samples along each axis. An array with neither has 1 mm, as raw samples have
        raw       for a path or bytes: describes them as raw samples
        name      the volume's name. Default: the name of the file or of its series
        masks     True says that the files of a folder or list are masks of one structure each. They become
                  one volume of labels with the files' names; `mesh` then makes all, unless `labels` is given
        modality  "ct" says that the samples are Hounsfield units, if the file does not say so. The volume
                  then has the presets of a CT, such as iso="bone"

        `series`, `member` and `volume` select one volume of several, `accept` and `nifti_form` settle
        what a file leaves open. An error names the one that helps. If the upload has several volumes,
        all are stored, and Refused lists their names in `choices`; see `upload_all`.

        Each note about the volume gives a VolumeWarning.
        """
        keywords = locals()
        return self._upload_one(source, False, {name: keywords[name] for name in (*_UPLOAD_KEYWORDS, "affine_space")})

    def upload_all(
        self, source: Source, *, name: str = "", accept: Sequence[str] = (), nifti_form: str = "", modality: str = ""
    ) -> List[api.UploadedVolumesVolumes]:
        """Stores every volume of a file, folder or archive. Each item of the result has the `volume`,
        or the `problem` for which the server rejected it."""
        body = uploads.of_source(source, None, "ras", None, None)
        chosen = {"accept": ",".join(accept), "nifti_form": nifti_form, "modality": modality}
        uploaded = self._exchange.upload(body, name, chosen)
        for each in uploaded:
            if each["volume"]:
                warn_of_notes(each["volume"]["notes"], each["member"] or body.name)
        return uploaded

    def volume(self, volume: Union[str, api.Volume]) -> api.Volume:
        """The server's description of a stored volume."""
        return cast("api.Volume", self._exchange.get(_volume_path(volume), answers.VOLUME))

    def volumes(self) -> Iterator[api.Volume]:
        """All stored volumes, the oldest first."""
        return cast("Iterator[api.Volume]", self._exchange.pages("/v1/volumes", "volumes", answers.VOLUME, {}))

    def rename(self, volume: Union[str, api.Volume], name: Optional[str]) -> api.Volume:
        """Gives a volume another name; None removes its name."""
        return cast("api.Volume", self._exchange.send_json("PATCH", _volume_path(volume), {"name": name}, answers.VOLUME))

    def reorient(self, volume: Union[str, api.Volume], axes: str) -> api.Volume:
        """Stores a flipped ("-x,y,z") or turned ("y,-x,z") copy of a volume. `axes` are those whose directions x, y and z get."""
        path = f"{_volume_path(volume)}/reoriented?{urlencode({'axes': axes})}"
        return cast("api.Volume", self._exchange.send_json("POST", path, None, answers.VOLUME))

    def erase(self, volume: Union[str, api.Volume], *, jobs: bool = False) -> None:
        """Deletes a volume from the server, with `jobs` also the ended jobs on it and their meshes."""
        self._exchange.delete(_volume_path(volume) + ("?jobs=erase" if jobs else ""))

    def histogram(self, volume: Union[str, api.Volume], bins: int = 256) -> api.Histogram:
        """How many samples have a value in each of `bins` equal intervals."""
        return cast("api.Histogram", self._exchange.get(f"{_volume_path(volume)}/histogram?bins={int(bins)}", answers.HISTOGRAM))

    def labels(self, volume: Union[str, api.Volume], background: int = 0) -> api.VolumeLabels:
        """The labels of a segmentation, with their voxels, volumes, names and colours."""
        query = {"background": str(int(background))}
        labels = list(self._exchange.pages(f"{_volume_path(volume)}/labels", "labels", answers.LABEL, query))
        return {"volume": _id_of(volume), "background": int(background), "labels": labels, "next": None}

    # --- Jobs ------------------------------------------------------------------------------------

    @by_keywords
    def submit(
        self,
        volume: Union[str, api.Volume],
        *,
        idempotency_key: str = "",
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
    ) -> api.Job:
        """Starts a job and returns at once: `client.submit(volume, iso=60, formats=["glb", "stl"])`.

        The keywords are parameters of the job; `help(isomesh_client.api.JobOptions)` describes them. The same
        `idempotency_key` always returns the same job, also in another process.
        """
        return self._submit(volume, idempotency_key, given(locals()))

    def job(self, job: Union[str, AnyJob]) -> api.Job:
        """The job as it is now."""
        return cast("api.Job", self._exchange.get(_job_path(job), answers.JOB))

    def jobs(
        self,
        state: Optional[api.JobState] = None,
        *,
        volume: Union[str, api.Volume, None] = None,
        since: str = "",
        until: str = "",
    ) -> Iterator[api.Job]:
        """All jobs, or those in one state, on one volume, or submitted `since` and before `until`, the newest
        first. A time is a day such as "2026-11-20", or a time in UTC such as "2026-11-20T07:30:00Z"."""
        chosen = {"state": state, "volume": _id_of(volume) if volume else "", "since": since, "until": until}
        query: Dict[str, str] = {key: value for key, value in chosen.items() if value}
        return cast("Iterator[api.Job]", self._exchange.pages("/v1/jobs", "jobs", answers.JOB, query))

    def wait(
        self,
        job: Union[str, AnyJob],
        *,
        timeout: Optional[float] = None,
        progress: Optional[Progress] = None,
    ) -> api.SucceededJob:
        """Waits until the job has succeeded and returns it. Raises JobFailed if it failed or was
        cancelled, and TimeoutError after `timeout` seconds. `progress` is called with the job about
        once a second."""
        end = float("inf") if timeout is None else time.monotonic() + timeout
        while True:
            asked = time.monotonic()
            longest = max(0.0, min(1.0 if progress else _LONGEST_WAIT, end - asked))
            target = f"{_job_path(job)}?wait={longest:.3f}"
            exchange = self._exchange if timeout is None else self._exchange.within(max(0.0, end - asked), longest)
            try:
                seen = cast("api.Job", exchange.get(target, answers.JOB, patience=longest))
            except (Refused, Unreachable) as error:
                is_busy = isinstance(error, Refused) and error.status in busy.STATUSES
                is_silent = isinstance(error, Unreachable) and time.monotonic() >= end
                if timeout is None or not (is_busy or is_silent):
                    raise
                raise TimeoutError(f"no retry is left in {timeout} s: {error}") from error
            if progress:
                progress(seen)
            if seen["state"] == "succeeded":
                return cast("api.SucceededJob", answers.checked(seen, answers.SUCCEEDED_JOB))
            if seen["state"] in FINAL_STATES:
                raise JobFailed(seen)
            if time.monotonic() >= end:
                raise TimeoutError(f"job {seen['id']} is {seen['state']} after {timeout} s")
            # A server that responds at once does not make this a busy loop.
            self._exchange.pause(max(0.0, min(longest, _SHORTEST_LOOK) - (time.monotonic() - asked)))

    def job_labels(self, job: Union[str, AnyJob]) -> List[api.LabelSummary]:
        """The labels of a succeeded job, in ascending order. With more than 256, `job["mesh"]` has only their number."""
        return cast("List[api.LabelSummary]", list(self._exchange.pages(f"{_job_path(job)}/labels", "labels", answers.LABEL, {})))

    def job_walls(self, job: Union[str, AnyJob], *, edge_contacts: bool = False) -> List[api.WallSummary]:
        """The areas where two labels of a succeeded job touch, or one is next to the background, whose `b` is None. In
        ascending order of labels. With `edge_contacts`, behind them, those of pairs that share no face of a voxel."""
        query = {"edge_contacts": "true"} if edge_contacts else {}
        return cast("List[api.WallSummary]", list(self._exchange.pages(f"{_job_path(job)}/walls", "walls", answers.WALL, query)))

    def report(self, job: Union[str, AnyJob]) -> api.JobReport:
        """What a succeeded job made, of what and how: to keep beside its mesh."""
        return cast("api.JobReport", self._exchange.get(f"{_job_path(job)}/report", answers.REPORT))

    def cancel(self, job: Union[str, AnyJob]) -> api.Job:
        """Cancels a job. A job that has ended stays as it is."""
        return cast("api.Job", self._exchange.cancel(_job_path(job)))

    def erase_job(self, job: Union[str, AnyJob]) -> None:
        """Deletes an ended job and its files from the server. A job that has not ended is cancelled instead."""
        self._exchange.delete(_job_path(job))

    @by_keywords
    def estimate(
        self,
        volume: Union[str, api.Volume],
        *,
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
    ) -> api.Estimate:
        """The exact numbers of triangles and vertices of a job, and what it takes, without running it."""
        query = {"volume": _id_of(volume), **as_query(given(locals()))}
        return cast("api.Estimate", self._exchange.get("/v1/estimate?" + urlencode(query), answers.ESTIMATE))

    # --- Meshes ----------------------------------------------------------------------------------

    def fetch(self, job: Union[str, AnyJob], *, allow_empty: bool = False) -> Mesh:
        """The mesh of a succeeded job as arrays. The job's `formats` must include "ply". If the volume is no longer
        stored, `mesh.notes` has only those on the mesh. Raises EmptySurface as `mesh` does."""
        done = self.job(job) if isinstance(job, str) else job
        expect_surface(done, allow_empty)
        file_of(done, "ply")
        notes: Sequence[api.Note] = ()
        with contextlib.suppress(Refused):
            notes = self.volume(done["volume"])["notes"]
        return self._fetch(cast("api.SucceededJob", done), notes)

    def download(
        self, job: Union[str, AnyJob], path: Union[str, os.PathLike[str]], *, label: Optional[int] = None, allow_empty: bool = False
    ) -> Path:
        """Writes a file of the job to `path` and returns that path. The suffix selects the format.
        `label` selects one label's own surface. The file appears only when it is complete and matches
        the job's SHA-256. An OBJ of all labels gets its materials beside it: for `x.obj` the file
        `x.mtl`, whose name replaces that in the OBJ. In that name, `_` stands for blanks and backslashes.
        Raises EmptySurface, and writes nothing, if the surface is empty and `allow_empty` is not True."""
        target = Path(path)
        done = self.job(job) if isinstance(job, str) else job
        form = format_of(target)
        expect_surface(done, allow_empty)
        labels: Iterable[api.LabelSummary] = ()
        if label is not None and done["mesh"] is not None:
            labels = done["mesh"].get("labels") or self.job_labels(done)
        announced = file_of(done, form, label, labels)
        is_by_labels = label is None and (done.get("parameters") or {}).get("labels") is not None
        beside = files_of_mesh(target, is_by_labels)[1:]
        with written(target) as file:
            arriving = Arriving(file, os.fsencode(beside[0].name) if beside else None)
            self._exchange.download(announced, arriving.write)
            arriving.finish()
            if arriving.names_materials:
                with written(beside[0]) as materials:
                    materials.write(self._exchange.text(f"{_job_path(done)}/mesh.mtl"))
        return target

    # --- How -------------------------------------------------------------------------------------

    def _made(
        self, source: Any, of_upload: Mapping[str, Any], parameters: Mapping[str, Any], progress: Optional[Progress]
    ) -> Tuple[api.Volume, api.SucceededJob]:
        """The volume of a source, which is uploaded if needed, and its job, which has succeeded."""
        if of_upload.get("masks") and "iso" not in parameters:
            parameters = {"labels": "all", **parameters}
        stored = self._stored(source, of_upload)
        if stored is None:
            stored = self._upload_one(source, "labels" in parameters, of_upload)
        key = uuid.uuid4().hex
        try:
            done = self.wait(self._submit(stored, key, parameters), progress=progress)
        except IsomeshError:
            raise
        except BaseException:  # an interrupt, or an exception of `progress`
            with contextlib.suppress(Exception):
                # The key finds the job even if its response was interrupted.
                parting = copy.copy(self)
                parting._exchange = self._exchange.parting()
                parting.cancel(parting._submit(stored, key, parameters))
            raise
        warn_of_notes(done["mesh"].get("notes", []), "the mesh")
        return stored, done

    def _stored(self, source: Any, of_upload: Mapping[str, Any]) -> Optional[api.Volume]:
        """The stored volume that `source` names; None for a source to upload."""
        if isinstance(source, Mapping):
            if not isinstance(source.get("notes"), list):
                raise TypeError("this dict is not a volume: give one that upload, volume or volumes returned")
            found = cast("api.Volume", source)  # its owner has seen the notes
        elif isinstance(source, str) and re.fullmatch("[0-9a-f]{64}", source) and not os.path.exists(source):
            found = self.volume(source)
            warn_of_notes(found["notes"], source[:12])  # the name may name a patient
        else:
            return None
        if of_upload:
            raise ValueError(f"{', '.join(of_upload)}: for uploads only, and this volume is stored already")
        return found

    def _upload_one(self, source: Any, is_by_labels: bool, keywords: Mapping[str, Any]) -> api.Volume:
        get = keywords.get
        number = get("volume")
        chosen = {
            "series": get("series", ""),
            "member": get("member", ""),
            "masks": "true" if get("masks", False) else "",
            "volume": "" if number is None else str(int(number)),
            "accept": ",".join(get("accept", ())),
            "nifti_form": get("nifti_form", ""),
            "modality": get("modality", ""),
        }
        body = uploads.of_source(source, get("affine"), get("affine_space", "ras"), get("spacing"), get("raw"))
        uploaded = self._exchange.upload(body, get("name", ""), chosen)
        if len(uploaded) == 1 and uploaded[0]["volume"] is not None:
            found = uploaded[0]["volume"]
            # This note advises what a job by labels does.
            notes = [each for each in found["notes"] if not (is_by_labels and each["code"] == _LOOKS_LIKE_LABELS)]
            warn_of_notes(notes, body.name)
            return found
        choices = [
            {
                "parameter": "member",
                "value": each["member"],
                "title": each["problem"]["detail"] if each["problem"] else "can be meshed",
            }
            for each in uploaded
        ]
        detail = f"the upload has {len(uploaded)} volumes; select one of them"
        raise Refused(422, {"detail": detail, "choices": choices})

    def _submit(self, volume: Union[str, api.Volume], idempotency_key: str, parameters: Mapping[str, Any]) -> api.Job:
        value = {"volume": _id_of(volume), **parameters}
        key = idempotency_key or uuid.uuid4().hex
        return cast("api.Job", self._exchange.send_json("POST", "/v1/jobs", value, answers.JOB, key))

    def _fetch(self, job: api.SucceededJob, notes: Sequence[api.Note]) -> Mesh:
        data = bytearray()
        self._exchange.download(file_of(job, "ply"), lambda at, piece: _put(data, at, piece))
        notes = [*notes, *job["mesh"].get("notes", [])]
        return Mesh(**ply.parse(data), job=job, notes=notes, download=self.download)


_UPLOAD_KEYWORDS = (
    *("affine", "spacing", "raw", "name"),
    *("series", "member", "masks", "volume", "accept", "nifti_form", "modality"),
)


def _is_empty(keyword: str, value: Any) -> bool:
    """True for a keyword's default. An empty place is no default but an error."""
    is_place = keyword in ("affine", "spacing")
    return value is None or value is False or not is_place and isinstance(value, (str, tuple, list)) and not value


def _put(data: bytearray, at: int, piece: bytes) -> None:
    data[at:] = piece
