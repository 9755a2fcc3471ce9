"""Functions whose expression is built once; a call inlines it, many times faster than operation by operation."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps

import casadi as ca

from symphys.types import Expr


def inlined(*sizes: int) -> Callable[[Callable[..., Expr]], Callable[..., Expr]]:
    """Build a function of column vectors of these sizes, which gives one matrix, only once (decorator).

    Results are those of the plain function: casadi repeats every operation, and drops those with 0 and 1.
    """

    def decorate(function: Callable[..., Expr]) -> Callable[..., Expr]:
        @cache
        def built() -> ca.Function:
            symbols = [ca.SX.sym(f"x{k}", size) for k, size in enumerate(sizes)]
            return ca.Function("inlined", symbols, [function(*symbols)])

        @wraps(function)
        def call(*arguments: Expr) -> Expr:
            return built().call(arguments)[0]

        return call

    return decorate
