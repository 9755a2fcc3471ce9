"""Tolerant readings of JSON that somebody else may have written: single values, and records by the types of fields."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from functools import cache, lru_cache
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from symphys.types import Array

Text = Callable[[object], str]
"""How a text is read: ``name``, or ``verbatim`` where the file is known to be this program's own."""
T = TypeVar("T")

NAME_LENGTH = 200
TEXT_LENGTH = 200_000

UNPRINTABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]")
"""Characters that XML forbids, that cannot be encoded, or that turn the direction of the text around them."""


def number(value: object) -> float:
    """A float; the strings ``nan``, ``inf``, ``-inf`` are read as such; nan for anything that is no number."""
    if type(value) is float:
        return value
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return np.nan
    try:
        return float(value)
    except (ValueError, OverflowError):
        return np.nan


def whole(value: object) -> int:
    """An int; 0 for anything that is no finite number."""
    read = number(value)
    return int(read) if np.isfinite(read) else 0


def numbers(value: object) -> Array:
    """(n,): the numbers of a list; empty for anything that is no list."""
    return np.array([number(entry) for entry in value] if isinstance(value, list) else [], float)


def vector(value: object, missing: float = 0.0) -> Array:
    """(3,): the first three numbers of a list; ``missing`` where one is absent or nan."""
    read = numbers(value)[:3]
    padded = np.concatenate([read, np.full(3 - read.size, np.nan)])
    return np.where(np.isnan(padded), missing, padded)


def table(value: object) -> dict[str, object]:
    """A JSON object; empty for anything else."""
    return {name(key): entry for key, entry in value.items()} if isinstance(value, dict) else {}


def tables(value: object) -> list[dict[str, object]]:
    """The objects of a JSON list; what is no object is left out."""
    return [table(entry) for entry in value if isinstance(entry, dict)] if isinstance(value, list) else []


def measures(value: object) -> dict[str, float]:
    """A JSON object of numbers."""
    return {key: number(entry) for key, entry in table(value).items()}


def words(value: object) -> str:
    """A text of any number of lines, safe to put into XML; empty for anything else."""
    return UNPRINTABLE.sub("\N{REPLACEMENT CHARACTER}", value[:TEXT_LENGTH]) if isinstance(value, str) else ""


def name(value: object) -> str:
    """A text of one line and bounded length; empty for anything that is neither text nor number."""
    if type(value) is str and len(value) <= NAME_LENGTH:
        return _line(value)
    if isinstance(value, int | float) and not isinstance(value, bool):
        value = repr(value)
    return one_line(value)


def one_line(value: object) -> str:
    """A text without line ends, cut to ``NAME_LENGTH``."""
    line = " ".join(words(value).split())
    return line if len(line) <= NAME_LENGTH else line[: NAME_LENGTH - 1] + "\N{HORIZONTAL ELLIPSIS}"


@lru_cache(maxsize=4096)
def _line(text: str) -> str:
    """Return ``one_line`` of a short text, cached: thousands of results have the same names in them."""
    return one_line(text)


def names(value: object) -> tuple[str, ...]:
    """The texts of a JSON list."""
    return tuple(name(entry) for entry in value) if isinstance(value, list) else ()


def verbatim(value: object) -> str:
    """A text as it is; empty for anything else."""
    return value if isinstance(value, str) else ""


def record(kind: type[T], value: object, text: Text = name, /, **given: Any) -> T:
    """A frozen dataclass from a JSON object whose keys are the names of its fields.

    A key that is absent gives the field's default; what is damaged, or absent without a default, becomes nan, an empty
    text or an empty collection. A field reads another key, or one in an object inside, where its metadata has ``key``
    (``"deepest_at.time"``). ``given``: fields that are read already.
    """
    entry = value if isinstance(value, dict) else {}
    found = dict(given)
    plan: Any = _plan(kind)  # type: ignore[arg-type]  # a class is hashable
    for each, hint, path, required in plan:
        content: Any = entry
        for key in path:
            content = content[key] if isinstance(content, dict) and key in content else MISSING
        if each not in given and (content is not MISSING or required):
            found[each] = _read(hint, None if content is MISSING else content, text)
    return kind(**found)


@cache
def _plan(kind: type[Any]) -> list[tuple[str, Any, tuple[str, ...], bool]]:
    """Name and type of each field of a record, the keys on the way to its value, and whether it has no default."""
    hints = get_type_hints(kind)
    return [
        (
            each.name,
            hints[each.name],
            tuple(each.metadata.get("key", each.name).split(".")),
            each.default is MISSING and each.default_factory is MISSING,
        )
        for each in fields(kind)
        if each.init
    ]


def _read(hint: Any, value: object, text: Text) -> Any:
    """A value as the type of a field asks for it."""
    simple: dict[Any, Callable[[object], object]] = {float: number, int: whole, bool: lambda v: v is True, str: text}
    if hint in simple:
        return simple[hint](value)
    if hasattr(hint, "from_json"):
        return hint.from_json(value, text)
    if is_dataclass(hint):
        return record(hint, value, text)  # type: ignore[arg-type]
    kind, inside = get_origin(hint), get_args(hint)
    if kind is tuple and inside[0] is str:
        return tuple(text(entry) for entry in value) if isinstance(value, list) else ()
    if kind is tuple:
        found = (_read(inside[0], entry, text) for entry in tables(value))
        return tuple(entry for entry in found if entry is not None)
    if kind is Mapping:
        known = {text(key): entry for key, entry in value.items()} if isinstance(value, dict) else {}
        return known if inside[1] is Any else {key: _read(inside[1], entry, text) for key, entry in known.items()}
    return numbers(value)
