"""Column vectors of casadi type (SX, MX, DM), the only values of formulas, and errors where shapes do not fit."""

from __future__ import annotations

from typing import Any

import casadi as ca

from symphys.errors import SymphysError
from symphys.types import Expr


class FormulaError(SymphysError):
    """Raised for a formula that cannot be read or evaluated; names the piece at fault and what is allowed."""


class UnfitError(ValueError):
    """Raised for values that an operation cannot take; becomes a FormulaError that names the piece of the formula."""


def column(value: Any) -> Expr:
    """Convert a number, a sequence of numbers or a casadi expression to a column (n,); UnfitError for a matrix."""
    expression = value if isinstance(value, ca.SX | ca.MX | ca.DM) else ca.DM(value)
    if expression.shape[1] != 1 or expression.shape[0] == 0:
        rows, columns = expression.shape
        raise UnfitError(f"its value is a {rows} x {columns} matrix; formulas know numbers and column vectors")
    return expression


def length(value: Expr) -> int:
    """Return the number of components; 1 for a number."""
    return int(value.shape[0])


def shape(value: Expr) -> str:
    """Return the shape in words."""
    return "a number" if length(value) == 1 else f"a vector of {length(value)}"


def require_fit(*values: Expr) -> None:
    """Raise UnfitError unless all values that are not numbers have the same length."""
    vectors = [value for value in values if length(value) > 1]
    for other in vectors[1:]:
        if length(other) != length(vectors[0]):
            raise UnfitError(f"{shape(vectors[0])} and {shape(other)} do not fit together")


def require_length(value: Expr, wanted: int, role: str) -> None:
    """Raise UnfitError unless ``value`` has ``wanted`` components."""
    if length(value) != wanted:
        raise UnfitError(f"{role} must have {wanted} components, but is {shape(value)}")


def require_same(a: Expr, b: Expr) -> None:
    """Raise UnfitError unless both have the same length."""
    if length(a) != length(b):
        raise UnfitError(f"both must have the same length, but they are {shape(a)} and {shape(b)}")


def join(*values: Expr) -> Expr:
    """Join all components to one column."""
    return ca.vertcat(*values)


def component(value: Expr, index: int) -> Expr:
    """Return one component, counted from 0, or from -1 backwards."""
    n = length(value)
    if not -n <= index < n:
        raise UnfitError(f"there is no component {index}: it is {shape(value)}, indices go from 0 to {n - 1}")
    return value[index]


def part(value: Expr, key: slice) -> Expr:
    """Return the components of a Python slice; unlike Python's, an empty one or one out of range is an error."""
    n = length(value)
    for end in (key.start, key.stop):
        if end is not None and not -n <= end <= n:
            raise UnfitError(f"the range reaches {end}, but it is {shape(value)}: ranges go from 0 to {n}")
    if key.step == 0:
        raise UnfitError("the step of the range is 0")
    indices = list(range(n))[key]
    if not indices:
        raise UnfitError("the range is empty")
    return value[indices]
