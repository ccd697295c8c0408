"""Paths of the API, of ids or of the objects that have them."""

from __future__ import annotations

from typing import Any
from urllib.parse import quote


def id_of(thing: Any) -> str:
    """Raises ValueError for what can be no id."""
    found = thing if isinstance(thing, str) else thing["id"]
    if not isinstance(found, str) or found in ("", ".", ".."):
        raise ValueError(f"{found!r} is not an id")
    return found


def volume_path(volume: Any) -> str:
    return "/v1/volumes/" + quote(id_of(volume), safe="")


def job_path(job: Any) -> str:
    return "/v1/jobs/" + quote(id_of(job), safe="")
