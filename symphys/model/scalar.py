"""The numbers of a world: plain, or symbols of casadi."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

Scalar = Any
"""float or casadi.SX"""


def is_zero(value: Scalar) -> bool:
    """Whether a number is structurally zero: a plain 0, or a casadi expression that is the constant 0."""
    return bool(value.is_zero()) if hasattr(value, "is_zero") else value == 0


def is_number(value: Any) -> bool:
    """Whether a number, or all numbers of tuples and dicts of them, are plain: no symbol is among them."""
    if isinstance(value, Mapping):
        return is_number(tuple(value.values()))
    if isinstance(value, Sequence) and not isinstance(value, str):
        return all(is_number(each) for each in value)
    return isinstance(value, int | float)
