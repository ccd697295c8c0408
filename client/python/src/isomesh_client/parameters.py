"""Job parameters: from the keywords of a call to JSON or a query."""

from __future__ import annotations

import difflib
import functools
import inspect
import operator
from typing import Any, Callable, Dict, Mapping, TypeVar, cast

from . import api

Call = TypeVar("Call", bound=Callable[..., Any])


class _Omitted:
    def __repr__(self) -> str:
        return "<default>"


# The value of a keyword that the caller left out: the server then uses its default. None is a value.
OMITTED: Any = _Omitted()


def given(keywords: Mapping[str, Any]) -> Dict[str, Any]:
    """The job parameters among `keywords` that the caller set, by the API's names."""
    names = api.JobOptions.__annotations__
    found = {name: value for name, value in keywords.items() if name in names and value is not OMITTED}
    for name in ("formats", "lods"):
        if isinstance(found.get(name), str):
            raise TypeError(f"{name} must be a list: {name}=[{found[name]!r}]")
    for name in ("label_names", "label_colors", "label_values"):
        if isinstance(found.get(name), Mapping):
            found[name] = {_label(key): value for key, value in found[name].items()}
    return {name.rstrip("_"): value for name, value in found.items()}


def _label(key: Any) -> Any:
    """A key as JSON takes it. Labels that come from an array are numpy's numbers."""
    return key if isinstance(key, str) else operator.index(key)


def by_keywords(method: Call) -> Call:
    """Rejects an unknown keyword before anything is sent, and accepts `lambda` from `**parameters`."""
    known = list(inspect.signature(method).parameters)

    @functools.wraps(method)
    def called(*arguments: Any, **keywords: Any) -> Any:
        if "lambda" in keywords and "lambda_" not in keywords:
            keywords["lambda_"] = keywords.pop("lambda")
        for name in keywords:
            if name not in known:
                near = difflib.get_close_matches(name, known, 1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                raise TypeError(f"{method.__name__}() has no parameter {name!r}{hint}")
        return method(*arguments, **keywords)

    return cast(Call, called)


def as_query(parameters: Mapping[str, Any]) -> Dict[str, str]:
    """The parameters of a query: the members of an object one by one, lists with commas. Names and colours of labels, which
    no query takes, change no number of an estimate. Raises ValueError for values of labels, which do."""
    if parameters.get("label_values"):
        raise ValueError("an estimate cannot tell label_values")
    query: Dict[str, str] = {}
    for name, value in parameters.items():
        if name in ("label_names", "label_colors", "label_values"):
            continue
        key = {"formats": "format"}.get(name, name)
        value = value.tolist() if hasattr(value, "tolist") else value
        if isinstance(value, dict):
            query.update(as_query(value))
        elif isinstance(value, bool):
            query[key] = "true" if value else "false"
        elif isinstance(value, (list, tuple)):
            query[key] = ",".join(str(each) for each in value)
        elif value is not None:
            query[key] = str(value)
    return query


def as_plain(value: Any) -> Any:
    """A JSON value of a numpy number or array."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"a value of type {type(value).__name__} cannot be sent as a parameter")
