"""Busy servers: how long they ask a client to wait, and how long it waits."""

from __future__ import annotations

import logging
import random
import re
import time
from datetime import datetime, timezone
from email.utils import parsedate_to_datetime
from typing import TYPE_CHECKING, Callable, Optional

if TYPE_CHECKING:
    from .errors import Refused

STATUSES = (429, 503)
# For the last requests of a caller that wants to end: for a busy server, and for a silent one.
PARTING_SECONDS = 2.0
PARTING_SILENCE = 5.0
_FIRST_PAUSE = 0.5  # seconds; without Retry-After each pause is twice as long as the one before
_LONGEST_PAUSE = 15.0
_LEAST_JITTER = 0.5

_log = logging.getLogger("isomesh_client")


def retry_after(value: str, date: str) -> Optional[float]:
    """The seconds of a Retry-After header, which are given as a number or as a date; None if there are
    none. `date` is the response's Date header, so that the two machines' clocks may differ."""
    if re.fullmatch(r"[0-9]+(\.[0-9]+)?", value.strip()):
        return float(value)
    then = _time_of(value)
    if then is None:
        return None
    return max(0.0, (then - (_time_of(date) or datetime.now(timezone.utc))).total_seconds())


def _time_of(text: str) -> Optional[datetime]:
    try:
        found = parsedate_to_datetime(text)
    except (TypeError, ValueError, IndexError, OverflowError):
        return None
    return found if found.tzinfo else found.replace(tzinfo=timezone.utc)


class Patience:
    """The pauses of one request while the server is busy: `seconds` in all, from its first refusal."""

    def __init__(self, seconds: float, sleep: Callable[[float], None]) -> None:
        self._seconds = seconds
        self._sleep = sleep
        self._end: Optional[float] = None
        self._pause = _FIRST_PAUSE

    def wait(self, error: Refused, excuse: Callable[[float], None]) -> None:
        """Returns when the request should be sent again. `excuse` gets the seconds before they pass. Raises
        `error` if waiting helps nothing, or if the time does not last until then."""
        if error.status not in STATUSES:
            raise error
        now = time.monotonic()
        if self._end is None:
            self._end = now + self._seconds
        pause = self._next_pause(error.retry_after)
        if pause > self._end - now:
            raise error
        _log.info("the server is busy (%s); the request is sent again in %.1f s", error.status, pause)
        excuse(pause)
        self._sleep(pause)

    def _next_pause(self, asked: Optional[float]) -> float:
        # Clients that were refused at the same time must not return at the same time.
        if asked:  # a date that has passed says as little as no header
            return asked + random.uniform(0, max(asked / 4, _LEAST_JITTER))
        pause = self._pause
        self._pause = min(2 * pause, _LONGEST_PAUSE)
        return random.uniform(pause / 2, pause)
