"""The names, functions and operators of formulas, each with its arguments and meaning."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from math import pi

import casadi as ca

from symphys.expression.columns import UnfitError, length, require_fit, require_length, require_same
from symphys.maths import angles, rotation
from symphys.records import dataclass
from symphys.types import Expr

CONSTANTS = {"pi": pi}
INSTANTS = ("start", "end")
"""Prefixes for the value at the first or last instant of a motion, as in ``end.knee.angle``."""
OF_INSTANTS = ("time", "alive")
"""Names without a dot that differ from instant to instant: ``end.time`` is the duration."""
OVER_TIME = {
    "integral": "integral(f): of a formula over the time of the motion",
    "average": "average(f): of a formula over the time of the motion",
}
"""Functions of a whole motion, and how they are written."""


NORM_WIDTH = 1e-12
"""norm(v) is sqrt(v . v + NORM_WIDTH^2), and hypot likewise: finite derivatives at 0, where the value is 1e-12."""


@dataclass(frozen=True)
class Function:
    """A function of formulas.

    Attributes:
        signature: how it is written.
        meaning: in one line.
        apply: columns to column; raises UnfitError where shapes do not fit.
        least, most: number of arguments; ``most`` None is any number.
    """

    signature: str
    meaning: str
    apply: Callable[..., Expr]
    least: int = 1
    most: int | None = 1


def elementwise(operation: Callable[..., Expr]) -> Callable[..., Expr]:
    """Return the operation component by component, with numbers combining with every component."""

    def apply(*values: Expr) -> Expr:
        require_fit(*values)
        return operation(*values)

    return apply


def larger(a: Expr, b: Expr) -> Expr:
    """Return the larger value; unlike fmax, NaN on either side gives NaN."""
    return ca.if_else(a > b, a, ca.if_else(b >= a, b, a + b))


def smaller(a: Expr, b: Expr) -> Expr:
    """Return the smaller value; unlike fmin, NaN on either side gives NaN."""
    return ca.if_else(a < b, a, ca.if_else(b <= a, b, a + b))


def extreme(choose: Callable[[Expr, Expr], Expr]) -> Callable[..., Expr]:
    """Return a function that takes the extreme component of one vector, or of several values component by component."""

    def apply(*values: Expr) -> Expr:
        if len(values) == 1:
            return reduce(choose, ca.vertsplit(values[0]))
        require_fit(*values)
        return reduce(choose, values)

    return apply


def clip(x: Expr, lower: Expr, upper: Expr) -> Expr:
    """Limit ``x`` to [lower, upper]."""
    return smaller(larger(x, lower), upper)


def smooth_larger(*arguments: Expr) -> Expr:
    """Return width * log(sum of exp(value / width)), with values shifted by the largest against overflow.

    It exceeds the largest of n values by at most width * log(n); the last argument is the width.
    """
    *values, width = arguments
    require_length(width, 1, "the width, the last argument,")
    if width.is_constant() and not bool(ca.DM(width) > 0):
        raise UnfitError("the width, the last argument, must be a number above 0")
    parts: list[Expr] = ca.vertsplit(values[0]) if len(values) == 1 else list(values)
    require_fit(*parts)
    top: Expr = reduce(larger, parts)
    total: Expr = ca.DM(0)
    for part in parts:
        total = total + ca.exp((part - top) / width)
    return top + width * ca.log(total)


def smooth_smaller(*arguments: Expr) -> Expr:
    """Return the mirror image of ``smooth_larger``: below the smallest by at most width * log(n)."""
    *values, width = arguments
    return -smooth_larger(*(-value for value in values), width)


def length_of(*squares: Expr) -> Expr:
    """Return sqrt(sum of the squares + NORM_WIDTH^2)."""
    return ca.sqrt(sum(squares) + NORM_WIDTH**2)


def hypot(a: Expr, b: Expr) -> Expr:
    """Return the length of (a, b)."""
    return length_of(a * a, b * b)


def norm(vector: Expr) -> Expr:
    """Return the Euclidean length."""
    return length_of(ca.dot(vector, vector))


def mean(vector: Expr) -> Expr:
    """Return the mean of the components."""
    total: Expr = ca.sum1(vector)
    return total / length(vector)


def dot(a: Expr, b: Expr) -> Expr:
    """Return the scalar product."""
    require_same(a, b)
    return ca.dot(a, b)


def cross(a: Expr, b: Expr) -> Expr:
    """Return the vector product."""
    require_length(a, 3, "the first vector")
    require_length(b, 3, "the second vector")
    return ca.cross(a, b)


def rotate(quaternion: Expr, vector: Expr) -> Expr:
    """Return the body-frame vector in world coordinates."""
    require_length(quaternion, 4, "the quaternion")
    require_length(vector, 3, "the vector")
    return rotation.rotate(quaternion, vector)


FUNCTIONS: dict[str, Function] = {
    "sin": Function("sin(x)", "sine of an angle [rad]", ca.sin),
    "cos": Function("cos(x)", "cosine of an angle [rad]", ca.cos),
    "tan": Function("tan(x)", "tangent of an angle [rad]", ca.tan),
    "asin": Function("asin(x)", "arc sine [rad]", ca.asin),
    "acos": Function("acos(x)", "arc cosine [rad]", ca.acos),
    "atan": Function("atan(x)", "arc tangent [rad]", ca.atan),
    "atan2": Function("atan2(y, x)", "angle [rad] of the point (x, y)", elementwise(ca.atan2), 2, 2),
    "wrap_to_pi": Function(
        "wrap_to_pi(x)", "an angle less whole turns, between -pi and pi; its slope is 1 everywhere", angles.wrap_to_pi
    ),
    "sinh": Function("sinh(x)", "hyperbolic sine", ca.sinh),
    "cosh": Function("cosh(x)", "hyperbolic cosine", ca.cosh),
    "tanh": Function("tanh(x)", "hyperbolic tangent", ca.tanh),
    "sqrt": Function("sqrt(x)", "square root; its slope at 0 is infinite", ca.sqrt),
    "exp": Function("exp(x)", "exponential", ca.exp),
    "log": Function("log(x)", "natural logarithm", ca.log),
    "abs": Function("abs(x)", "absolute value, component by component", ca.fabs),
    "sign": Function("sign(x)", "-1, 0 or 1", ca.sign),
    "min": Function(
        "min(a, b, ...)", "smallest, component by component; of one vector its least", extreme(smaller), 1, None
    ),
    "max": Function(
        "max(a, b, ...)", "largest, component by component; of one vector its greatest", extreme(larger), 1, None
    ),
    "smooth_max": Function(
        "smooth_max(a, b, ..., width)",
        "max with rounded corners: width log(sum exp(a / width))",
        smooth_larger,
        2,
        None,
    ),
    "smooth_min": Function("smooth_min(a, b, ..., width)", "min with rounded corners", smooth_smaller, 2, None),
    "clip": Function("clip(x, lower, upper)", "x limited to a range", elementwise(clip), 3, 3),
    "hypot": Function("hypot(a, b)", "sqrt(a^2 + b^2), finite slope at 0", elementwise(hypot), 2, 2),
    "norm": Function("norm(v)", "Euclidean length, finite slope at 0", norm),
    "sumsqr": Function("sumsqr(v)", "sum of the squared components", ca.sumsqr),
    "sum": Function("sum(v)", "sum of the components", ca.sum1),
    "mean": Function("mean(v)", "mean of the components", mean),
    "dot": Function("dot(a, b)", "scalar product", dot, 2, 2),
    "cross": Function("cross(a, b)", "vector product of two vectors of 3", cross, 2, 2),
    "rotate": Function(
        "rotate(quaternion, v)",
        "a body-frame vector in world coordinates: rotate(ball.orientation, [1, 0, 0])",
        rotate,
        2,
        2,
    ),
}
