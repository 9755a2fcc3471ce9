"""Drawable numbers: axes, their ticks and derived lengths overflow far below the largest double.

Tables have every number as it is. Figures leave out what is beyond ``MAX_DRAWABLE``, and the page says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")
MAX_DRAWABLE = 1e50
"""Largest drawable number in any unit; its sixth power is still a double."""
OVERSIZED = f"Numbers beyond {MAX_DRAWABLE:g} are left out of the figures; tables have them."


def small(numbers: Any) -> bool:
    """Whether all numbers are finite and can be drawn."""
    return bool(np.all(np.abs(np.asarray(numbers, float)) <= MAX_DRAWABLE))


def largest(array: Any) -> float:
    """Return the largest size of the finite numbers; 0 without any."""
    sizes = np.abs(np.asarray(array, float))
    return float(np.max(sizes[np.isfinite(sizes)], initial=0.0))


def drawable(value: T) -> T:
    """Return a record, or a part of one, with nan for every number that is finite and cannot be drawn."""
    found: Any = value
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        found = np.where(np.isfinite(value) & (np.abs(value) > MAX_DRAWABLE), np.nan, value)
    elif isinstance(value, float) and np.isfinite(value) and abs(value) > MAX_DRAWABLE:
        found = np.nan
    elif isinstance(value, Mapping):
        found = {key: drawable(entry) for key, entry in value.items()}
    elif isinstance(value, tuple):
        found = tuple(drawable(entry) for entry in value)
    elif is_dataclass(value) and not isinstance(value, type):
        found = replace(value, **{field.name: drawable(getattr(value, field.name)) for field in fields(value)})
    return found  # type: ignore[no-any-return]


def oversized(value: Any) -> bool:
    """Whether a number in a record, or a part of one, is finite and cannot be drawn."""
    if isinstance(value, float) or (isinstance(value, np.ndarray) and value.dtype.kind == "f"):
        return largest(value) > MAX_DRAWABLE
    if isinstance(value, Mapping):
        return any(map(oversized, value.values()))
    if isinstance(value, tuple):
        return any(map(oversized, value))
    if is_dataclass(value) and not isinstance(value, type):
        return any(oversized(getattr(value, field.name)) for field in fields(value))
    return False
