"""Uploads that resume where their connection broke: "Resumable Uploads for HTTP"
(draft-ietf-httpbis-resumable-upload). docs/uploads.md describes the part that the server supports."""

from __future__ import annotations

import json
import re
import time
from typing import Dict, Iterator, Optional, Union

from . import uploads
from .errors import IsomeshError, Refused, Unreachable, WrongAnswer, warn
from .transport import Answer, Request, Transport
from .uploads import Body

RESUMABLE_BYTES = 8 << 20  # smaller bodies are sent in one request
_PLACES = "/v1/uploads/"
_NOT_THE_API = "the server's response does not follow the API"
_LONGEST_CUT = 60.0  # seconds without progress, then the upload fails
_FIRST_PAUSE = 0.1
_LONGEST_PAUSE = 3.0
# Temporary: a proxy does not reach the server, or the server has not yet noticed the broken connection. While the
# server is busy, Transport.send waits.
_PASSING = (408, 409, 502, 504)


def send(transport: Transport, target: str, headers: Dict[str, str], body: Body) -> Answer:
    """The response to `POST target` with this body. Raises as Transport.send does."""
    place = _begin(transport, target, headers, body)
    try:
        return _finish(transport, target, body, place)
    except Unreachable:
        raise  # there is no server to tell
    except BaseException as error:
        if isinstance(error, Refused) and error.status == 410:
            # The upload has expired, or another daemon than the one that holds it responds.
            return transport.send(Request("POST", target, headers, body))
        _give_up(transport, place)
        raise


def _give_up(transport: Transport, place: str) -> None:
    try:
        answer = transport.parting().send(Request("DELETE", place))
        if answer.status != 200:
            return
        ids = ", ".join(volume["id"] for volume in json.loads(answer.text())["volumes"])
    except (IsomeshError, ValueError, KeyError, TypeError, RecursionError):
        return  # the caller raises the reason; the server deletes the upload when it expires
    if ids:
        warn(f"the upload was cancelled too late: the server has stored the volume {ids}")


def _is_cancelled(error: Refused) -> bool:
    """True if somebody else has cancelled the upload."""
    return str(error.problem.get("type", "")).endswith(":cancelled")


def _begin(transport: Transport, target: str, headers: Dict[str, str], body: Body) -> str:
    """The address of the upload."""
    told = {**headers, "Upload-Complete": "?0", "Upload-Length": str(body.size)}
    # An upload whose address is lost has no bytes, and expires.
    answer = transport.repeated(Request("POST", target, told, uploads.of_bytes(b"")))
    place = re.sub("^https?://[^/]*", "", answer.header("Location"))  # a proxy may have made it absolute
    if not place.startswith(_PLACES):
        raise WrongAnswer(_NOT_THE_API)
    return place


class _Outage:
    """When to give an upload up that does not get on. The outage begins with the first failure after progress. A part
    that fails may have been received in part, which only the server knows. So nothing is given up before it was asked."""

    def __init__(self) -> None:
        self.pause = _FIRST_PAUSE
        self._since: Optional[float] = None
        self._reached = 0

    def fail(self) -> None:
        self._since = time.monotonic() if self._since is None else self._since

    def hear(self, offset: int) -> None:
        """With each answer of the server."""
        if offset > self._reached:
            self._since, self.pause, self._reached = None, _FIRST_PAUSE, offset

    def excuse(self, seconds: float) -> None:
        """With the time for which the client waits because the server is busy, which is no outage."""
        if self._since is not None:
            self._since += seconds

    def is_over(self) -> bool:
        return self._since is not None and time.monotonic() - self._since >= _LONGEST_CUT

    def next_pause(self) -> float:
        pause, self.pause = self.pause, min(2 * self.pause, _LONGEST_PAUSE)
        return pause


def _finish(transport: Transport, target: str, body: Body, place: str) -> Answer:
    offset: Optional[int] = 0  # None: unknown
    is_whole = False
    failure: Optional[Union[Refused, Unreachable]] = None
    outage = _Outage()
    while True:
        if failure and offset is not None and outage.is_over():
            raise failure
        try:
            if offset is None:
                state = _look(transport, place, outage)
                offset, is_whole = _offset_in(state, body.size), state.header("Upload-Complete") == "?1"
                outage.hear(offset)
                continue
            if is_whole:
                # The body has arrived: this asks for the response that was lost.
                sign = "&" if "?" in target else "?"
                target_again = f"{target}{sign}upload={place.rpartition('/')[2]}"
                return transport.send_whole(Request("POST", target_again, {}, uploads.of_bytes(b"")), outage.excuse)
            part = {
                "Content-Type": "application/partial-upload",
                "Upload-Complete": "?1",
                "Upload-Offset": str(offset),
            }
            return transport.send_whole(Request("PATCH", place, part, _after(body, offset)), outage.excuse)
        except (Refused, Unreachable) as error:
            if isinstance(error, Refused) and (error.status not in _PASSING or _is_cancelled(error)):
                raise
            outage.fail()
            if offset is None and outage.is_over():
                raise
            failure = error
        offset = None
        transport.pause(outage.next_pause())


def _look(transport: Transport, place: str, outage: _Outage) -> Answer:
    try:
        return transport.send_whole(Request("HEAD", place), outage.excuse)
    except Refused as error:
        if error.status != 409:
            raise
        # The reason of a conflict is in the body of a GET.
        return transport.send_whole(Request("GET", place), outage.excuse)


def _offset_in(state: Answer, size: int) -> int:
    text = state.header("Upload-Offset")
    if not re.fullmatch("[0-9]{1,20}", text) or int(text) > size:
        raise WrongAnswer(_NOT_THE_API)
    return int(text)


def _after(body: Body, offset: int) -> Body:
    def pieces() -> Iterator[bytes]:
        left = offset
        for piece in body.pieces():
            if left < len(piece):
                yield piece[left:]
            left = max(0, left - len(piece))

    return Body(body.size - offset, pieces)
