"""What can go wrong, as exceptions; all of them are IsomeshError."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Mapping, Optional, Sequence, cast

if TYPE_CHECKING:
    from .api import Job


class IsomeshError(Exception):
    """Anything that this package raises, but for ValueError and TypeError of wrong arguments."""


class Unreachable(IsomeshError):
    """No answer of a server came: it is not there, or the connection broke."""


class WrongAnswer(IsomeshError):
    """What came is not what the API says, or a mesh is not the one that its job describes."""


class Refused(IsomeshError):
    """The server's refusal.

    `status` is its HTTP status and `problem` the document that says why (RFC 9457); `choices` and
    `overridable` of it tell what would help, where something does.
    """

    def __init__(self, status: int, problem: Mapping[str, Any]) -> None:
        text = str(problem.get("detail") or problem.get("title") or f"the server answered {status}")
        super().__init__(text + _remedy(self._list(problem, "choices"), problem.get("overridable")))
        self.status = status
        self.problem = problem

    @property
    def choices(self) -> Sequence[Mapping[str, str]]:
        """What an upload may be asked for, as `{"parameter", "value", "title"}`."""
        return self._list(self.problem, "choices")

    @property
    def overridable(self) -> Optional[str]:
        """The note that `accept` would have the upload taken with."""
        return cast(Optional[str], self.problem.get("overridable"))

    @staticmethod
    def _list(problem: Mapping[str, Any], name: str) -> Sequence[Mapping[str, str]]:
        found = problem.get(name)
        return found if isinstance(found, list) else []


class JobFailed(IsomeshError):
    """A job that was waited for has failed or was cancelled; `job` is that job."""

    def __init__(self, job: Job) -> None:
        problem: Mapping[str, Any] = cast("Mapping[str, Any]", job.get("error") or {})
        reason = problem.get("detail") or f"the job was {job['state']}"
        super().__init__(f"job {job['id']}: {reason}")
        self.job = job


def refusal(status: int, content_type: str, body: bytes) -> Refused:
    """The exception for an answer that is no success; something in front of the server may send
    other than problem documents."""
    problem: object = None
    if content_type.startswith(("application/problem+json", "application/json")):
        try:
            problem = json.loads(body)
        except ValueError:
            problem = None
    return Refused(status, problem if isinstance(problem, dict) else {})


def _remedy(choices: Sequence[Mapping[str, str]], overridable: object) -> str:
    text = ""
    for choice in choices[:20]:
        text += f"\n  {choice.get('parameter')}={choice.get('value')!r}: {choice.get('title')}"
    if len(choices) > 20:
        text += f"\n  and {len(choices) - 20} more"
    return text + (f"\n  accept=[{overridable!r}] takes it nevertheless" if overridable else "")
