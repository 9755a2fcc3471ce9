"""A casadi expression of x and y as a formula of a problem file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

from symphys.errors import SymphysError

LONGEST = 20_000
"""Characters; beyond that an expression repeats so much that a grid of heights serves better."""
WORDS: dict[int, str] = {
    ca.OP_ADD: "({} + {})",
    ca.OP_SUB: "({} - {})",
    ca.OP_MUL: "({} * {})",
    ca.OP_DIV: "({} / {})",
    ca.OP_POW: "({} ** {})",
    ca.OP_CONSTPOW: "({} ** {})",
    ca.OP_SQ: "({} ** 2)",
    ca.OP_TWICE: "(2 * {})",
    ca.OP_NEG: "(-{})",
    ca.OP_INV: "(1 / {})",
    ca.OP_ATAN2: "atan2({}, {})",
    ca.OP_FABS: "abs({})",
    ca.OP_FMIN: "min({}, {})",
    ca.OP_FMAX: "max({}, {})",
    ca.OP_ASSIGN: "{}",
} | {
    getattr(ca, f"OP_{name.upper()}"): f"{name}({{}})"
    for name in ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "sqrt", "exp", "log", "sign")
}
"""By casadi's operations, with places for their arguments."""


def formula_text(height: Callable[[Any, Any], Any]) -> str:
    """The formula of a function of casadi scalars x and y.

    Raises:
        SymphysError: names an operation that formulas do not have.
    """
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    made = ca.Function("height", [x, y], [ca.densify(ca.SX(height(x, y)))])
    values: dict[int, str] = {}
    text = "0"
    for k in range(made.n_instructions()):
        operation, given, out = made.instruction_id(k), made.instruction_input(k), made.instruction_output(k)
        if operation == ca.OP_OUTPUT:
            text = values[given[0]]
        elif operation == ca.OP_INPUT:
            values[out[0]] = ("x", "y")[given[0]]
        elif operation == ca.OP_CONST:
            constant = made.instruction_constant(k)
            values[out[0]] = repr(constant) if constant >= 0 else f"({constant!r})"
        elif operation not in WORDS:
            raise SymphysError("it has an operation that formulas lack, such as a comparison or if_else")
        else:
            values[out[0]] = WORDS[operation].format(*(values[i] for i in given))
            if len(values[out[0]]) > LONGEST:
                raise SymphysError(f"its formula is longer than {LONGEST} characters")
    return text
