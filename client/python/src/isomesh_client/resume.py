"""Uploads that resume where their connection broke: "Resumable Uploads for HTTP"
(draft-ietf-httpbis-resumable-upload). docs/uploads.md describes the part that the server supports."""

from __future__ import annotations

import json
import time
from typing import Dict, Iterator, Optional, Union

from . import busy, uploads
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
        answer = transport.within(busy.PARTING_SECONDS).send(Request("DELETE", place))
        told = answer.text()
    except IsomeshError:
        return  # the server deletes the upload when it expires
    if answer.status == 200:
        ids = ", ".join(volume["id"] for volume in json.loads(told)["volumes"])
        warn(f"the upload was cancelled too late: the server has stored the volume {ids}")


def _is_cancelled(error: Refused) -> bool:
    """True if somebody else has cancelled the upload."""
    return str(error.problem.get("type", "")).endswith(":cancelled")


def _begin(transport: Transport, target: str, headers: Dict[str, str], body: Body) -> str:
    """The address of the upload."""
    told = {**headers, "Upload-Complete": "?0", "Upload-Length": str(body.size)}
    answer = transport.send(Request("POST", target, told, uploads.of_bytes(b"")))
    answer.text()
    place = answer.header("Location")
    if not place.startswith(_PLACES):
        raise WrongAnswer(_NOT_THE_API)
    return place


def _finish(transport: Transport, target: str, body: Body, place: str) -> Answer:
    offset: Optional[int] = 0  # None: unknown
    reached = 0
    is_whole = False
    cut: Optional[float] = None  # when it broke, if there was no progress since then
    failure: Optional[Union[Refused, Unreachable]] = None
    wait = _FIRST_PAUSE
    while True:
        # A part that failed may have got on, so the upload is given up only after HEAD.
        if failure and offset is not None and _is_over(cut):
            raise failure
        try:
            if offset is None:
                state = _look(transport, place)
                offset, is_whole = _offset_in(state, body.size), state.header("Upload-Complete") == "?1"
                if offset > reached:
                    cut, wait, reached = None, _FIRST_PAUSE, offset
                continue
            if is_whole:
                # The body has arrived: this asks for the response that was lost.
                sign = "&" if "?" in target else "?"
                target_again = f"{target}{sign}upload={place.rpartition('/')[2]}"
                return transport.send(Request("POST", target_again, {}, uploads.of_bytes(b"")))
            part = {
                "Content-Type": "application/partial-upload",
                "Upload-Complete": "?1",
                "Upload-Offset": str(offset),
            }
            return transport.send(Request("PATCH", place, part, _after(body, offset)))
        except (Refused, Unreachable) as error:
            if isinstance(error, Refused) and (error.status not in _PASSING or _is_cancelled(error)):
                raise
            cut = time.monotonic() if cut is None else cut
            if offset is None and _is_over(cut):
                raise
            failure = error
        offset = None
        time.sleep(wait)
        wait = min(2 * wait, _LONGEST_PAUSE)


def _is_over(cut: Optional[float]) -> bool:
    return cut is not None and time.monotonic() - cut >= _LONGEST_CUT


def _look(transport: Transport, place: str) -> Answer:
    try:
        state = transport.send(Request("HEAD", place))
    except Refused as error:
        if error.status != 409:
            raise
        # The reason of a conflict is in the body of a GET.
        state = transport.send(Request("GET", place))
    state.text()
    return state


def _offset_in(state: Answer, size: int) -> int:
    text = state.header("Upload-Offset")
    if not text.isdigit() or int(text) > size:
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
