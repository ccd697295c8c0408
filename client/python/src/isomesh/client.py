"""A client of an isomesh server."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import time
import uuid
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterator, List, Optional, Sequence, Union, cast
from urllib.parse import quote, urlencode

from . import resume, uploads
from .errors import JobFailed, Refused, WrongAnswer
from .mesh import Mesh, read_ply
from .transport import Answer, Broken, Request, Transport, pause

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from . import api
    from .uploads import Body, Raw

    Source = Union[str, os.PathLike[str], Sequence[Union[str, os.PathLike[str]]], bytes, bytearray, memoryview, Any]

_TRIES = 4
_LONGEST_WAIT = 30.0  # seconds, the server's
_SHORTEST_LOOK = 0.2
_MULTI_STATUS = 207
_FINAL = ("succeeded", "failed", "cancelled")


class Client:
    """A client of one server. Constant after construction: it may be used from several threads.

    server       http://HOST:PORT, https://HOST:PORT or unix:PATH; else of ISOMESH_SERVER, else
                 http://127.0.0.1:8080
    token        the bearer token, where the server wants one; else of ISOMESH_TOKEN
    authorities  a file of the certificate authorities to trust; else of ISOMESH_CA, else the system's
    timeout      seconds that the server may be silent

    Wherever a volume or a job is asked for, its id does as well as what the server answered about it.

    Raises Refused with the server's reason, Unreachable when no answer came, WrongAnswer for one that
    is not what the API says, and ValueError or TypeError for arguments that cannot be sent. What can
    be repeated safely is sent again when its connection breaks: reading, and submitting a job. Uploads
    of 8 MiB or more go on where theirs broke, if it is not broken for longer than a minute.
    """

    def __init__(
        self,
        server: Optional[str] = None,
        *,
        token: Optional[str] = None,
        authorities: Optional[str] = None,
        timeout: float = 300,
    ) -> None:
        environment = os.environ.get
        self.server = server or environment("ISOMESH_SERVER") or "http://127.0.0.1:8080"
        token = token if token is not None else environment("ISOMESH_TOKEN", "")
        authorities = authorities or environment("ISOMESH_CA") or None
        self._transport = Transport(self.server, token, authorities, timeout)

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
        volume: Optional[int] = None,
        accept: Sequence[str] = (),
        nifti_form: str = "",
        **parameters: Unpack[api.JobOptions],
    ) -> Mesh:
        """From a volume to its surface in one call: `client.mesh("head.nii.gz", iso=60)`.

        `source` and the other named arguments are as `upload` takes them; everything else is a
        parameter of the job. Vertices are in LPS, whatever the affine is in, unless `space` says "ras";
        `mesh.in_space` turns them. Raises JobFailed. Interrupted, it cancels the job.
        """
        stored = self.upload(
            source,
            affine=affine,
            affine_space=affine_space,
            spacing=spacing,
            raw=raw,
            name=name,
            series=series,
            member=member,
            volume=volume,
            accept=accept,
            nifti_form=nifti_form,
        )
        formats = list(parameters.get("formats", []))
        parameters["formats"] = cast(Any, formats if "ply" in formats else [*formats, "ply"])
        job = self.submit(stored, **parameters)
        try:
            job = self.wait(job)
        except KeyboardInterrupt:
            self.cancel(job)
            raise
        return self.fetch(job)

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
        volume: Optional[int] = None,
        accept: Sequence[str] = (),
        nifti_form: str = "",
    ) -> api.Volume:
        """Stores a volume and returns what the server says of it. The same samples and geometry
        again are the same volume.

        source    a path: of a file, of a folder of DICOM slices, of a header with its data beside it;
                  several paths that belong together; the bytes of a file;
                  a numpy array of three axes, the first of which is x;
                  an image of nibabel's, or anything with `dataobj` and `affine`
        affine    of an array: the 4 x 4 matrix that takes its indices to millimetres of `affine_space`
        affine_space  what `affine` is in: "ras", as nibabel's and NIfTI's, or "lps", as DICOM's and ITK's
        spacing   of an array in place of `affine`: millimetres between samples along its axes
        raw       of a path or bytes: that they are bare samples, and of what kind
        name      what the volume is called; else as the file or its series

        The others choose among what a file holds, or accept what it lacks, as the server's refusal
        names them. An upload of several volumes raises Refused with their names as `choices`; they
        are stored nevertheless (see `upload_all`).
        """
        chosen = {"series": series, "member": member, "volume": "" if volume is None else str(int(volume))}
        body = self._body_of(source, affine, affine_space, spacing, raw)
        answers = self._upload(body, name, {**chosen, "accept": ",".join(accept), "nifti_form": nifti_form})
        if len(answers) == 1 and answers[0]["volume"] is not None:
            return answers[0]["volume"]
        choices = [
            {
                "parameter": "member",
                "value": each["member"],
                "title": each["problem"]["detail"] if each["problem"] else "stored",
            }
            for each in answers
        ]
        detail = f"the upload holds {len(answers)} volumes, where one is needed"
        raise Refused(422, {"detail": detail, "choices": choices})

    def upload_all(
        self, source: Source, *, name: str = "", accept: Sequence[str] = (), nifti_form: str = ""
    ) -> List[api.UploadedVolumesVolumes]:
        """As `upload`, for a file, folder or archive that may hold several volumes: each is answered
        for by `volume`, or by the `problem` for which it was refused."""
        body = self._body_of(source, None, "ras", None, None)
        return self._upload(body, name, {"accept": ",".join(accept), "nifti_form": nifti_form})

    def volume(self, volume: Union[str, api.Volume]) -> api.Volume:
        return cast("api.Volume", self._get(_volume_path(volume)))

    def volumes(self) -> Iterator[api.Volume]:
        """All of them, the oldest first."""
        return cast("Iterator[api.Volume]", self._pages("/v1/volumes", "volumes", {}))

    def rename(self, volume: Union[str, api.Volume], name: Optional[str]) -> api.Volume:
        """Gives a volume another name, or none."""
        return cast("api.Volume", self._send_json("PATCH", _volume_path(volume), {"name": name}))

    def erase(self, volume: Union[str, api.Volume]) -> None:
        self._transport.send(Request("DELETE", _volume_path(volume))).text()

    def histogram(self, volume: Union[str, api.Volume], bins: int = 256) -> api.Histogram:
        return cast("api.Histogram", self._get(f"{_volume_path(volume)}/histogram?bins={int(bins)}"))

    def labels(self, volume: Union[str, api.Volume], background: int = 0) -> api.VolumeLabels:
        """The labels that a volume of whole numbers has: voxels, mm3, names and colours."""
        return cast("api.VolumeLabels", self._get(f"{_volume_path(volume)}/labels?background={int(background)}"))

    # --- Jobs ------------------------------------------------------------------------------------

    def submit(
        self,
        volume: Union[str, api.Volume],
        *,
        idempotency_key: str = "",
        **parameters: Unpack[api.JobOptions],
    ) -> api.Job:
        """Starts a job: `client.submit(volume, iso=60, formats=["glb", "stl"])`.

        The parameters are those of the API, all but `volume`; `lambda_` is `lambda`. The same
        `idempotency_key` gives the same job again, also to another process.
        """
        asked: Dict[str, object] = {"volume": _id_of(volume)}
        asked.update((name.rstrip("_"), value) for name, value in parameters.items())
        key = idempotency_key or uuid.uuid4().hex
        body = self._json_request("POST", "/v1/jobs", asked, {"Idempotency-Key": key})
        return cast("api.Job", _parsed(self._transport.repeat(body)))

    def job(self, job: Union[str, api.Job]) -> api.Job:
        return cast("api.Job", self._get(_job_path(job)))

    def jobs(self, state: Optional[api.JobState] = None) -> Iterator[api.Job]:
        """All of them, or those in one state, the newest first."""
        return cast("Iterator[api.Job]", self._pages("/v1/jobs", "jobs", {"state": state} if state else {}))

    def wait(
        self,
        job: Union[str, api.Job],
        *,
        timeout: Optional[float] = None,
        progress: Optional[Callable[[api.Job], None]] = None,
    ) -> api.Job:
        """The job when it has succeeded. Raises JobFailed when it failed or was cancelled, and
        TimeoutError after `timeout` seconds. `progress` is called with the job about once a second."""
        end = None if timeout is None else time.monotonic() + timeout
        while True:
            asked = time.monotonic()
            longest = 1.0 if progress else _LONGEST_WAIT
            if end is not None:
                longest = max(0, min(longest, end - asked))
            path = f"{_job_path(job)}?wait={longest:.3f}"
            seen = cast("api.Job", _parsed(self._transport.repeat(Request("GET", path, patience=longest))))
            if progress:
                progress(seen)
            if seen["state"] == "succeeded":
                return seen
            if seen["state"] in _FINAL:
                raise JobFailed(seen)
            if end is not None and time.monotonic() >= end:
                raise TimeoutError(f"job {seen['id']} is {seen['state']} after {timeout} s")
            # A server that answers at once is not asked without end.
            time.sleep(max(0.0, min(longest, _SHORTEST_LOOK) - (time.monotonic() - asked)))

    def cancel(self, job: Union[str, api.Job]) -> api.Job:
        """Asks a job to end; one that has ended stays as it is."""
        return cast("api.Job", _parsed(self._transport.send(Request("DELETE", _job_path(job))).text()))

    def estimate(self, volume: Union[str, api.Volume], **parameters: Unpack[api.JobOptions]) -> api.Estimate:
        """What a job would make and take, without running it: exact triangles and vertices."""
        query = {"volume": _id_of(volume), **_as_query(cast("Dict[str, object]", parameters))}
        return cast("api.Estimate", self._get("/v1/estimate?" + urlencode(query)))

    # --- Meshes ----------------------------------------------------------------------------------

    def fetch(self, job: Union[str, api.Job]) -> Mesh:
        """The mesh of a job that was asked for the format "ply", as arrays."""
        done = self.job(job) if isinstance(job, str) else job
        announced = _file_of(done, "ply", None)
        data = bytearray()
        self._download(announced, lambda at, piece: _put(data, at, piece))
        return read_ply(data, done)

    def download(
        self, job: Union[str, api.Job], path: Union[str, os.PathLike[str]], *, label: Optional[int] = None
    ) -> Path:
        """Writes a job's mesh to `path`, whose suffix says the format, and returns that path. The
        file appears only when all of its bytes have come and are those that the job describes. Of a
        job by labels, with `label`, one label's own surface."""
        target = Path(path)
        done = self.job(job) if isinstance(job, str) else job
        announced = _file_of(done, target.suffix.lower().lstrip("."), label)
        number, part = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        try:
            with os.fdopen(number, "wb") as file:

                def write(at: int, piece: bytes) -> None:
                    file.seek(at)
                    file.write(piece)

                self._download(announced, write)
                file.flush()
                os.fsync(file.fileno())
            # As any new file; mkstemp's are for their owner alone.
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(part, 0o666 & ~mask)
            os.replace(part, target)
        except BaseException:
            os.unlink(part)
            raise
        return target

    # --- How -------------------------------------------------------------------------------------

    def _body_of(
        self, source: Any, affine: Any, space: str, spacing: Optional[Sequence[float]], raw: Optional[Raw]
    ) -> Body:
        is_array = False
        if isinstance(source, (str, os.PathLike)):
            body = uploads.of_paths([Path(source)])
        elif isinstance(source, (bytes, bytearray)) or type(source) is memoryview:
            body = uploads.of_bytes(source)
        elif isinstance(source, (list, tuple)) and source and all(isinstance(p, (str, os.PathLike)) for p in source):
            body = uploads.of_paths([Path(each) for each in source])
        else:
            is_array = True
            if hasattr(source, "dataobj") and hasattr(source, "affine"):
                affine = source.affine if affine is None and spacing is None else affine
                source = source.dataobj
            elif not hasattr(source, "__array__"):
                raise TypeError(f"cannot upload {type(source).__name__}: give a path, bytes, an array or an image")
            body = uploads.of_array(source, affine, space, spacing)
        if is_array and raw is not None:
            raise ValueError("raw describes files and bytes; an array says itself what it is")
        if not is_array and (affine is not None or spacing is not None):
            raise ValueError("affine and spacing are for arrays; a file says itself where its samples lie")
        if raw is not None:
            body.query = raw.query()
        return body

    def _upload(self, body: Body, name: str, chosen: Dict[str, str]) -> List[api.UploadedVolumesVolumes]:
        query = {**body.query, **{key: value for key, value in chosen.items() if value}}
        headers = {"Content-Type": "application/octet-stream"}
        if name or body.name:
            # Names may name patients: they go in a header, because logs hold targets.
            headers["Content-Disposition"] = f"attachment; filename*=UTF-8''{quote(name or body.name, safe='')}"
        target = "/v1/volumes" + ("?" + urlencode(query) if query else "")
        if body.size >= resume.RESUMABLE_BYTES:
            answer = resume.send(self._transport, target, headers, body)
        else:
            answer = self._transport.send(Request("POST", target, headers, body))
        parsed = _parsed(answer.text())
        if answer.status == _MULTI_STATUS:
            return cast("List[api.UploadedVolumesVolumes]", parsed["volumes"])
        volume = cast("api.Volume", parsed)
        return [{"member": "", "status": answer.status, "volume": volume, "problem": None}]

    def _download(self, announced: api.MeshFile, write: Callable[[int, bytes], None]) -> None:
        """Takes a broken download up where it broke."""
        size, digest, at = announced["bytes"], hashlib.sha256(), 0
        for attempt in range(1, _TRIES + 1):
            headers = {"Range": f"bytes={at}-", "If-Range": f'"{announced["sha256"]}"'} if at else {}
            try:
                answer = self._transport.send(Request("GET", announced["href"], headers))
                if at and not _goes_on(answer, at):
                    digest, at = hashlib.sha256(), 0
                for piece in answer.pieces():
                    write(at, piece)
                    digest.update(piece)
                    at += len(piece)
                break
            except Broken:
                if attempt == _TRIES:
                    raise
            pause(attempt)
        if at != size or digest.hexdigest() != announced["sha256"]:
            raise WrongAnswer("the mesh that arrived is not the one that the job describes")

    def _get(self, target: str) -> Dict[str, Any]:
        return _parsed(self._transport.repeat(Request("GET", target)))

    def _pages(self, path: str, member: str, query: Dict[str, str]) -> Iterator[Any]:
        while True:
            page = self._get(path + ("?" + urlencode(query) if query else ""))
            yield from page[member]
            if not page["next"] or not page[member]:
                return
            query = {**query, "cursor": page["next"]}

    def _json_request(self, method: str, target: str, value: object, headers: Dict[str, str]) -> Request:
        try:
            text = json.dumps(value, allow_nan=False, default=_as_plain).encode()
        except ValueError as error:
            raise ValueError(f"a parameter cannot be sent: {error}") from error
        return Request(method, target, {"Content-Type": "application/json", **headers}, uploads.of_bytes(text))

    def _send_json(self, method: str, target: str, value: object) -> Dict[str, Any]:
        return _parsed(self._transport.send(self._json_request(method, target, value, {})).text())


def _id_of(thing: Any) -> str:
    found = thing if isinstance(thing, str) else thing["id"]
    if not isinstance(found, str) or found in ("", ".", ".."):
        raise ValueError(f"{found!r} is no id")
    return found


def _volume_path(volume: Any) -> str:
    return "/v1/volumes/" + quote(_id_of(volume), safe="")


def _job_path(job: Any) -> str:
    return "/v1/jobs/" + quote(_id_of(job), safe="")


def _parsed(body: bytes) -> Dict[str, Any]:
    try:
        value = json.loads(body)
    except ValueError as error:
        raise WrongAnswer("the server's answer is no JSON") from error
    if not isinstance(value, dict):
        raise WrongAnswer("the server's answer is no object")
    return value


def _as_plain(value: Any) -> Any:
    """Numbers and lists of numpy as those of JSON."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be sent as a parameter")


def _as_query(parameters: Dict[str, object]) -> Dict[str, str]:
    """As the table of parameters spells them in a query: groups by their members, lists with
    commas."""
    query: Dict[str, str] = {}
    for name, value in parameters.items():
        key = {"formats": "format"}.get(name, name.rstrip("_"))
        value = value.tolist() if hasattr(value, "tolist") else value
        if isinstance(value, dict):
            query.update(_as_query(value))
        elif isinstance(value, bool):
            query[key] = "true" if value else "false"
        elif isinstance(value, (list, tuple)):
            query[key] = ",".join(str(each) for each in value)
        elif value is not None:
            query[key] = str(value)
    return query


def _file_of(job: api.Job, form: str, label: Optional[int]) -> api.MeshFile:
    mesh = job["mesh"]
    if mesh is None:
        if job["state"] in _FINAL:
            raise JobFailed(job)
        raise ValueError(f"job {job['id']} is {job['state']}: `wait` for it first")
    files: Any = mesh["files"]
    if label is not None:
        files = next((each["files"] for each in mesh.get("labels", []) if each["label"] == label), {})
    if form in files:
        return cast("api.MeshFile", files[form])
    of_label = "" if label is None else f" of the label {label}"
    has = ", ".join(files) or "none"
    raise ValueError(f"job {job['id']} has no file of the format {form!r}{of_label}; it has {has}")


def _goes_on(answer: Answer, at: int) -> bool:
    return answer.status == 206 and answer.header("Content-Range").startswith(f"bytes {at}-")


def _put(data: bytearray, at: int, piece: bytes) -> None:
    data[at:] = piece
