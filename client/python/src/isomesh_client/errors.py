"""The package's exceptions, all of them IsomeshError, and its warning."""

from __future__ import annotations

import json
import os
import re
import sys
import warnings
from typing import TYPE_CHECKING, Any, Mapping, Optional, Sequence, cast

if TYPE_CHECKING:
    from . import api


class IsomeshError(Exception):
    """The base class of this package's exceptions. Wrong arguments raise ValueError or TypeError."""

    def __init__(self, text: str = "") -> None:
        super().__init__(_printable(text))


class Unreachable(IsomeshError):
    """No response arrived: there is no server, or the connection broke."""


class WrongAnswer(IsomeshError):
    """A response does not follow the API, or a mesh is not the one that its job describes."""


class VolumeWarning(UserWarning):
    """A note about a volume, which the server decided or corrected when it read the file, or about a mesh, such as walls
    that are too thin."""


def warn_of_notes(notes: Sequence[api.Note], name: str) -> None:
    """Warns of each note about the volume that is called `name`; it may be empty."""
    for note in notes:
        warn((f"{name}: " if name else "") + f"{note['detail']} ({note['code']})")


def warn(text: str) -> None:
    """A VolumeWarning at the line that called this package."""
    frame: Any = sys._getframe()
    level = 1
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_HERE):
        frame, level = frame.f_back, level + 1
    warnings.warn(_printable(text), VolumeWarning, stacklevel=level)


def _printable(text: str) -> str:
    """The same without control characters, which a server may send to the terminal; tabs and line breaks stay."""
    return re.sub(r"[\0-\x08\x0b-\x1f\x7f-\x9f]", "\ufffd", text)


_HERE = os.path.dirname(__file__) + os.sep


class Refused(IsomeshError):
    """The server rejected a request.

    `status` is the HTTP status, and `problem` is the server's explanation (RFC 9457). `choices` and
    `overridable` say how to repeat an upload so that the server accepts it, if there is a way.
    `retry_after` is the number of seconds after which a busy server (429, 503) wants the request again;
    None if it does not say.
    """

    def __init__(self, status: int, problem: Mapping[str, Any], retry_after: Optional[float] = None) -> None:
        text = str(problem.get("detail") or problem.get("title") or f"the server responded with status {status}")
        super().__init__(text + _remedy(self._list(problem, "choices"), problem.get("overridable")))
        self.status = status
        self.problem = problem
        self.retry_after = retry_after

    @property
    def choices(self) -> Sequence[Mapping[str, str]]:
        """The arguments of `upload` to choose from, each as {"parameter", "value", "title"}."""
        return self._list(self.problem, "choices")

    @property
    def overridable(self) -> Optional[str]:
        """The code of a note: with it in `accept`, the server accepts the upload."""
        return cast(Optional[str], self.problem.get("overridable"))

    @staticmethod
    def _list(problem: Mapping[str, Any], name: str) -> Sequence[Mapping[str, str]]:
        found = problem.get(name)
        return [each for each in found if isinstance(each, dict)] if isinstance(found, list) else []


class JobFailed(IsomeshError):
    """A job has failed or was cancelled. `job` is the job."""

    def __init__(self, job: api.Job) -> None:
        problem: Mapping[str, Any] = cast("Mapping[str, Any]", job.get("error") or {})
        reason = problem.get("detail") or f"the job was {job['state']}"
        super().__init__(f"job {job['id']}: {reason}")
        self.job = job


class EmptySurface(IsomeshError):
    """A job has succeeded, and its mesh has no triangles. `allow_empty=True` accepts that. `job` is the job."""

    def __init__(self, job: api.SucceededJob) -> None:
        reason = job["mesh"].get("empty_reason")
        super().__init__("the surface is empty" + (f": {reason}" if reason else "") + "; allow_empty=True accepts that")
        self.job = job


def refusal(status: int, content_type: str, body: bytes, retry_after: Optional[float]) -> Refused:
    """The exception for an unsuccessful response. A proxy's response may have no problem document."""
    problem: object = None
    if content_type.startswith(("application/problem+json", "application/json")):
        try:
            problem = json.loads(body)
        except (ValueError, RecursionError):
            problem = None
    return Refused(status, problem if isinstance(problem, dict) else {}, retry_after)


def _remedy(choices: Sequence[Mapping[str, str]], overridable: object) -> str:
    text = ""
    for choice in choices[:20]:
        text += f"\n  {choice.get('parameter')}={choice.get('value')!r}: {choice.get('title')}"
    if len(choices) > 20:
        text += f"\n  and {len(choices) - 20} more"
    return text + (f"\n  accept=[{overridable!r}] accepts the volume as it is" if overridable else "")
