"""Tolerant readings of single values from files that somebody else may have written."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NAME_LENGTH = 200
TEXT_LENGTH = 200_000

UNPRINTABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]")
"""Characters that XML forbids, that cannot be encoded, or that turn the direction of the text around them."""


def number(value: object) -> float:
    """A float; the strings ``nan``, ``inf``, ``-inf`` are read as such; nan for anything that is no number."""
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
    if isinstance(value, int | float) and not isinstance(value, bool):
        value = repr(value)
    line = " ".join(words(value).split())
    return line if len(line) <= NAME_LENGTH else line[: NAME_LENGTH - 1] + "\N{HORIZONTAL ELLIPSIS}"


def names(value: object) -> tuple[str, ...]:
    """The texts of a JSON list."""
    return tuple(name(entry) for entry in value) if isinstance(value, list) else ()
