"""The API's requests over a transport: JSON, pages of lists, uploads and downloads."""

from __future__ import annotations

import contextlib
import hashlib
import json
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterator, List, cast
from urllib.parse import quote, urlencode

from . import answers, resume, uploads
from .errors import WrongAnswer
from .parameters import as_plain
from .transport import Answer, Broken, Request, Transport

if TYPE_CHECKING:
    from . import api
    from .answers import Members
    from .stopping import Stop
    from .uploads import Body

_TRIES = 4
_MULTI_STATUS = 207


class Exchange:
    """Constant after construction, so several threads may share it."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport

    def within(self, seconds: float, patience: float = 0) -> Exchange:
        """The same exchange, which waits that long for a busy server, and little longer for a silent one. `patience` is that
        of its requests, which is part of the time."""
        return Exchange(self._transport.within(seconds, patience))

    def until(self, stop: Stop) -> Exchange:
        """The same exchange, whose requests and pauses raise Stopped as soon as `stop` is set."""
        return Exchange(self._transport.until(stop))

    def parting(self) -> Exchange:
        """The same exchange for the last requests of a caller that wants to end."""
        return Exchange(self._transport.parting())

    def pause(self, seconds: float) -> None:
        self._transport.pause(seconds)

    def get(self, target: str, members: Members, patience: float = 0) -> Dict[str, Any]:
        """The response's object. Raises WrongAnswer if it lacks one of the `members`."""
        return _parsed(self._transport.repeat(Request("GET", target, patience=patience)), members)

    def text(self, target: str) -> bytes:
        return self._transport.repeat(Request("GET", target))

    def pages(self, path: str, member: str, items: Members, query: Dict[str, str]) -> Iterator[Any]:
        """The items of all pages of a list."""
        while True:
            page = self.get(path + ("?" + urlencode(query) if query else ""), answers.page_of(member, items))
            yield from page[member]
            if not page["next"] or not page[member]:
                return
            query = {**query, "cursor": page["next"]}

    def delete(self, target: str) -> bytes:
        return self._transport.send(Request("DELETE", target)).text()

    def cancel(self, target: str) -> Dict[str, Any]:
        return _parsed(self.delete(target + "?erase=false"), answers.JOB)

    def send_json(self, method: str, target: str, value: object, members: Members, key: str = "") -> Dict[str, Any]:
        """With an idempotency key, the request is repeated when its connection breaks."""
        try:
            text = json.dumps(value, allow_nan=False, default=as_plain).encode()
        except ValueError as error:
            raise ValueError(f"a parameter cannot be sent: {error}") from error
        headers = {"Content-Type": "application/json", **({"Idempotency-Key": key} if key else {})}
        request = Request(method, target, headers, uploads.of_bytes(text))
        return _parsed(self._transport.repeat(request) if key else self._transport.send(request).text(), members)

    def upload(self, body: Body, name: str, chosen: Dict[str, str]) -> List[api.UploadedVolumesVolumes]:
        """One item for each volume of the upload. `chosen` are query parameters, left out if empty."""
        query = {**body.query, **{key: value for key, value in chosen.items() if value}}
        headers = {"Content-Type": "application/octet-stream"}
        if name or body.name:
            # A name may name a patient: it goes in a header, because logs hold the target.
            kind, text = ("name", name) if name else ("filename", body.name)
            headers["Content-Disposition"] = f"attachment; {kind}*=UTF-8''{quote(text, safe='')}"
        target = "/v1/volumes" + ("?" + urlencode(query) if query else "")
        if body.size >= resume.RESUMABLE_BYTES:
            answer = resume.send(self._transport, target, headers, body)
        else:
            answer = self._transport.send(Request("POST", target, headers, body))
        if answer.status == _MULTI_STATUS:
            return cast("List[api.UploadedVolumesVolumes]", _parsed(answer.text(), answers.UPLOADED)["volumes"])
        volume = cast("api.Volume", _parsed(answer.text(), answers.VOLUME))
        return [{"member": "", "status": answer.status, "volume": volume, "problem": None}]

    def download(self, announced: api.MeshFile, write: Callable[[int, bytes], None]) -> None:
        """Downloads a file and resumes where its connection breaks."""
        answers.checked(announced, answers.MESH_FILE)
        size, digest, at = announced["bytes"], hashlib.sha256(), 0
        for attempt in range(1, _TRIES + 1):
            headers = {"Range": f"bytes={at}-", "If-Range": f'"{announced["sha256"]}"'} if at else {}
            try:
                answer = self._transport.send(Request("GET", announced["href"], headers))
                if at and not _goes_on(answer, at):
                    digest, at = hashlib.sha256(), 0
                for piece in answer.pieces():
                    if at + len(piece) > size:
                        raise WrongAnswer("the downloaded mesh is longer than its job says")
                    write(at, piece)
                    digest.update(piece)
                    at += len(piece)
                break
            except Broken:
                if attempt == _TRIES:
                    raise
            self._transport.rest(attempt)
        if at != size or digest.hexdigest() != announced["sha256"]:
            raise WrongAnswer("the downloaded mesh does not match the job's SHA-256")


def _whole(label: Any) -> Any:
    with contextlib.suppress(ValueError, TypeError):
        return int(label)
    return label


def _with_whole_labels(members: Dict[str, Any]) -> Dict[str, Any]:
    """Labels of 64 bits are strings in JSON, because other languages would round the number."""
    if isinstance(members.get("label"), str):
        members["label"] = _whole(members["label"])
    labels = members.get("labels")
    if isinstance(labels, list) and any(isinstance(label, str) for label in labels):
        members["labels"] = [_whole(label) for label in labels]
    return members


def _parsed(body: bytes, members: Members) -> Dict[str, Any]:
    try:
        value = json.loads(body, object_hook=_with_whole_labels)
    except (ValueError, RecursionError) as error:
        raise WrongAnswer("the server's response is not JSON") from error
    return answers.checked(value, members)


def _goes_on(answer: Answer, at: int) -> bool:
    return answer.status == 206 and answer.header("Content-Range").startswith(f"bytes {at}-")
