"""The members of the server's responses that this package relies on, and a check that they are there."""

from __future__ import annotations

from typing import Any, Dict, Mapping

from .errors import WrongAnswer

# Each member's kind: a type, an object with the members of a dict, a list of one kind, or any kind of a tuple.
# Members that only callers read are not checked, so servers of other versions stay usable.
Members = Mapping[str, Any]

_NULL = type(None)
_MESH: Members = {"empty": bool, "files": dict}
VOLUME: Members = {"id": str, "notes": [{"code": str, "detail": str}]}
UPLOADED: Members = {
    "volumes": [{"member": str, "volume": (VOLUME, _NULL), "problem": ({"detail": str}, _NULL)}],
}
HISTOGRAM: Members = {"counts": list}
LABEL: Members = {"label": int}
WALL: Members = {"a": (int, str), "area_mm2": (int, float)}
ESTIMATE: Members = {"triangles": int}
JOB: Members = {"id": str, "state": str, "volume": str, "mesh": (_MESH, _NULL), "error": (dict, _NULL)}
SUCCEEDED_JOB: Members = {"mesh": _MESH}
REPORT: Members = {"job": SUCCEEDED_JOB, "volume": (dict, _NULL)}
MESH_FILE: Members = {"bytes": int, "sha256": str, "href": str}
_ABSENT = object()


def page_of(member: str, items: Members) -> Members:
    return {member: [items], "next": (str, _NULL)}


def checked(value: Any, members: Members) -> Dict[str, Any]:
    """`value`, if it is an object with these members. Raises WrongAnswer if it is not."""
    if not isinstance(value, dict):
        raise WrongAnswer("the server's response is not a JSON object")
    for name, kind in members.items():
        if not _is(value.get(name, _ABSENT), kind):
            raise WrongAnswer(f"the server's response does not follow the API: {name!r} is missing or wrong")
    return value


def _is(value: Any, kind: Any) -> bool:
    if isinstance(kind, tuple):
        return any(_is(value, each) for each in kind)
    if isinstance(kind, list):
        return isinstance(value, list) and all(_is(each, kind[0]) for each in value)
    if isinstance(kind, dict):
        return isinstance(value, dict) and all(_is(value.get(name, _ABSENT), each) for name, each in kind.items())
    return isinstance(value, kind)
