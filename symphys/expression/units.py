"""Units of formulas, from those of the names in them: where the rules below leave no doubt, else none.

A number takes the unit of what it is added to or compared with. As a factor it may hide a unit, as 9.81 does: only 0,
1/2, 1 and 2, with either sign, count as pure numbers there. Everything else has no unit: sums of unlike units, sines of
lengths, roots of odd powers, angles times lengths.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from functools import partial
from operator import neg, pos
from typing import Any

from symphys.expression import columns
from symphys.expression.formula import Apply, Constant, Formula, Node, Reference
from symphys.expression.functions import FUNCTIONS
from symphys.expression.parse import OPERATORS

Powers = Mapping[str, int]
"""The power of each base unit; a pure number has none."""
Found = Powers | None
"""None: not known."""

NAMED = {
    "N": {"kg": 1, "m": 1, "s": -2},
    "N m": {"kg": 1, "m": 2, "s": -2},
    "N/m": {"kg": 1, "s": -2},
    "N s": {"kg": 1, "m": 1, "s": -1},
    "N m/rad": {"kg": 1, "m": 2, "s": -2, "rad": -1},
}
"""Derived units with a name of their own."""
BASE = ("kg", "m", "s", "rad")
PURE = (0.0, 0.5, 1.0, 2.0)
"""Sizes of factors that are pure numbers."""
NUMBER: Powers = {"number": 1}
"""The unit of constants, which take the unit of what they are added to."""
KEEPING = ("abs", "wrap_to_pi", "min", "max", "smooth_max", "smooth_min", "clip", "hypot", "norm", "sum", "mean")
"""Functions that keep the unit of their arguments."""


def unit_of(formula: Formula, units: Mapping[str, str]) -> str:
    """Return the unit of a formula's value; empty if it has none or if it is not clear.

    Args:
        formula: that is read.
        units: of the names, such as ``{"ball.velocity": "m/s"}``; a pure number has "", and a name that is absent is
            one whose unit is not known.
    """
    found = infer(formula.root, {**units, **part_units(formula, units)})
    return "" if found is None or found == NUMBER else written(found)


def part_units(formula: Formula, units: Mapping[str, str]) -> dict[str, str]:
    """Return the known units of a formula's parts of a whole motion."""
    known = {}
    for part in formula.parts:
        powers = infer(part.formula.root, units)
        if powers is None or (powers == NUMBER and part.kind == "integral"):
            continue
        powers = combined(powers, {"s": 1}) if part.kind == "integral" else powers
        text = "" if powers == NUMBER else written(powers)
        if text or not powers:
            known[part.name] = text
    return known


def infer(node: Node, units: Mapping[str, str]) -> Found:
    """Return the powers of a node's unit; None if unknown."""
    if isinstance(node, Constant):
        return NUMBER
    if isinstance(node, Reference):
        return read(units[node.name]) if node.name in units else None
    parts = [infer(argument, units) for argument in node.arguments]
    function = node.function.func if isinstance(node.function, partial) else node.function
    rule = RULES.get(function)
    return None if rule is None or None in parts else rule(node, [part for part in parts if part is not None])


def read(text: str) -> Found:
    """Return the powers of a unit such as ``N m/rad`` or ``m/s^2``; None for an unknown unit."""
    total: dict[str, int] = {}
    for place, part in enumerate(text.split("/")):
        for factor in part.split():
            name, _, power = factor.partition("^")
            known: Found = {} if name == "1" else {name: 1} if name in BASE else NAMED.get(name)
            if known is None or not (power or "1").isdigit():
                return None
            times = int(power or 1) * (-1 if place else 1)
            total = dict(combined(total, known, times))
    return total


def written(powers: Powers) -> str:
    """Return the unit as text; empty for a pure number, and for mixtures of angles that give no unit in use."""
    for name, known in NAMED.items():
        if known == powers:
            return name
    if "rad" in powers and ("m" in powers or "kg" in powers):
        return ""
    above = [f"{name}{exponent(powers[name])}" for name in BASE if powers.get(name, 0) > 0]
    below = [f"{name}{exponent(-powers[name])}" for name in BASE if powers.get(name, 0) < 0]
    return "/".join([" ".join(above) or "1", *below]) if powers else ""


def exponent(power: int) -> str:
    """Return ``^2`` and the like; empty for 1."""
    return f"^{power}" if power > 1 else ""


def combined(one: Powers, other: Powers, times: int = 1) -> Powers:
    """Return the powers of one unit times another to a power."""
    total = {name: one.get(name, 0) + times * other.get(name, 0) for name in {**one, **other}}
    return {name: power for name, power in total.items() if power}


def alike(node: Apply, parts: list[Powers]) -> Found:
    """Return the common unit of the arguments, for functions that keep it."""
    known = [part for part in parts if part != NUMBER]
    return known[0] if known and all(part == known[0] for part in known) else None


def factor(argument: Node, part: Powers) -> Found:
    """Return the powers of a factor; None for a constant that may hide a unit."""
    if part != NUMBER:
        return part
    pure = isinstance(argument, Constant) and all(abs(number) in PURE for number in argument.value.nonzeros())
    return {} if pure else None


def product(node: Apply, parts: list[Powers], times: int = 1) -> Found:
    """Return the unit of a product, or with -1 of a quotient."""
    one, other = (factor(argument, part) for argument, part in zip(node.arguments, parts, strict=True))
    return None if one is None or other is None else combined(one, other, times)


def power(node: Apply, parts: list[Powers]) -> Found:
    """Return the unit of a power whose exponent is a whole number."""
    exponents = node.arguments[1]
    whole = isinstance(exponents, Constant) and exponents.value.numel() == 1 and float(exponents.value).is_integer()
    if parts[0] == NUMBER or not whole or not isinstance(exponents, Constant):
        return None
    return combined({}, parts[0], int(float(exponents.value)))


def root(node: Apply, parts: list[Powers]) -> Found:
    """Return the unit of a square root."""
    if any(power % 2 for power in parts[0].values()):
        return None
    return {name: power // 2 for name, power in parts[0].items()}


def turned(node: Apply, parts: list[Powers]) -> Found:
    """Return the unit of a vector that a quaternion rotates."""
    return parts[1] if parts[0] in ({}, NUMBER) and parts[1] != NUMBER else None


def giving(result: Powers, *allowed: Powers) -> Callable[[Apply, list[Powers]], Found]:
    """Return the rule of a function with a unit of its own; ``allowed``: units of its argument."""
    return lambda node, parts: result if parts[0] in allowed else None


RULES: dict[Callable[..., Any], Callable[[Apply, list[Powers]], Found]] = {
    **dict.fromkeys((OPERATORS[ast.Add], OPERATORS[ast.Sub], neg, pos), alike),
    **dict.fromkeys((columns.join, columns.component, columns.part), alike),
    **{FUNCTIONS[name].apply: alike for name in KEEPING},
    OPERATORS[ast.Mult]: product,
    OPERATORS[ast.Div]: partial(product, times=-1),
    OPERATORS[ast.Pow]: power,
    **{FUNCTIONS[name].apply: product for name in ("dot", "cross")},
    FUNCTIONS["sumsqr"].apply: lambda node, parts: combined({}, parts[0], 2),
    FUNCTIONS["sqrt"].apply: root,
    FUNCTIONS["rotate"].apply: turned,
    FUNCTIONS["atan2"].apply: lambda node, parts: None if alike(node, parts) is None else {"rad": 1},
    **{FUNCTIONS[name].apply: giving({}, {}, {"rad": 1}) for name in ("sin", "cos", "tan")},
    **{FUNCTIONS[name].apply: giving({"rad": 1}, {}) for name in ("asin", "acos", "atan")},
    **{FUNCTIONS[name].apply: giving({}, {}) for name in ("sinh", "cosh", "tanh", "exp", "log")},
}
"""The rule for the unit of each function's value; without a rule the unit is unknown."""
