"""The numbers of a world: plain, or symbols of casadi."""

from __future__ import annotations

from typing import Any

Scalar = Any
"""float or casadi.SX"""


def is_zero(value: Scalar) -> bool:
    """Whether a number is structurally zero: a plain 0, or a casadi expression that is the constant 0."""
    return bool(value.is_zero()) if hasattr(value, "is_zero") else value == 0
