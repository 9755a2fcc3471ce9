"""Every operation that kernels know, as functions of two vectors."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from symphys.codegen import FunctionCall, MemoryLayout, Program

ARGUMENTS = (3, 2)
SMOOTH = [
    ca.sin, ca.cos, ca.tanh, ca.atan, ca.erf, ca.asinh, ca.fabs, ca.sign, ca.floor, ca.ceil,
    lambda a: a**2, lambda a: -a, lambda a: 2 * a, lambda a: ca.exp(ca.tanh(a)), lambda a: ca.log(1 + ca.fabs(a)),
    lambda a: ca.sqrt(1 + a * a), lambda a: 1 / (1 + a * a), lambda a: (1 + ca.fabs(a)) ** 1.5,
    lambda a: ca.log1p(ca.fabs(a)), lambda a: ca.expm1(ca.tanh(a)), lambda a: ca.tan(ca.sin(a)),
    lambda a: ca.asin(ca.tanh(a)), lambda a: ca.acos(ca.tanh(a)), lambda a: ca.cosh(ca.sin(a)),
    lambda a: ca.sinh(ca.cos(a)), lambda a: ca.acosh(1.5 + a * a), lambda a: ca.atanh(0.9 * ca.sin(a)),
]  # fmt: skip
PAIRS = [
    lambda a, b: a + b, lambda a, b: a - b, lambda a, b: a * b, lambda a, b: a / (1 + b * b), ca.fmin, ca.fmax,
    ca.atan2, ca.hypot, ca.copysign, lambda a, b: ca.fmod(a, 1 + b * b), lambda a, b: ca.remainder(a, 1 + b * b),
    lambda a, b: (1 + a * a) ** ca.tanh(b), lambda a, b: ca.if_else(a < b, a, b * b), lambda a, b: a <= b,
    lambda a, b: ca.if_else(ca.logic_and(a > 0, ca.logic_not(b > 0)), a, 0), lambda a, b: ca.logic_or(a, b < 0),
    lambda a, b: ca.if_else(a == b, 1, b), lambda a, b: (a != b) + 3 * a, lambda a, b: ca.fmin(a, 0.5) + b,
    lambda a, b: ca.fmax(0.25, b) - a, lambda a, b: ca.if_else(a, b, 1.5),
]  # fmt: skip


def build(steps: list[tuple[int, int, int]]) -> Any:
    """A function of two arguments from random operations on what there is so far; all values are results."""
    x, y = (ca.SX.sym(name, size) for name, size in zip("xy", ARGUMENTS, strict=True))
    values = [*ca.vertsplit(x), *ca.vertsplit(y), ca.SX(0.5)]
    for op, i, j in steps:
        a, b = values[i % len(values)], values[j % len(values)]
        values.append(SMOOTH[op](a) if op < len(SMOOTH) else PAIRS[op - len(SMOOTH)](a, b))
    return ca.Function("random", [x, y], [ca.vertcat(*values[6:]), values[-1] + x])


def alone(functions: list[Any]) -> Program:
    """Each function once, on z."""
    at = MemoryLayout()
    x, y = (at.take(size) for size in ARGUMENTS)
    calls = [FunctionCall(f, (x, y), tuple(at.take(f.numel_out(i)) for i in range(f.n_out()))) for f in functions]
    results = {f"f{i}r{j}": place for i, call in enumerate(calls) for j, place in enumerate(call.outputs)}
    z = type(x)(x.offset, sum(ARGUMENTS))
    return Program(at.size, z, type(x)(0, 0), 0, results, prologue=tuple(calls))


def every_operation() -> list[Any]:
    """A function for each operation, on different operands and on equal ones."""
    ops = range(len(SMOOTH) + len(PAIRS))
    return [build([(op, 0, 4)]) for op in ops] + [build([(op, 2, 2)]) for op in ops]


def long_function() -> Any:
    """A function of 1200 operations whose values do not grow."""
    random = np.random.default_rng(5)
    smooth = [0, 1, 2, 15, 16]  # no growth
    steps = [(int(random.choice(smooth)), *map(int, random.integers(0, 10**6, 2))) for _ in range(900)]
    steps += [(len(SMOOTH) + k % 3, *map(int, random.integers(0, 900, 2))) for k in range(300)]
    return build(steps)
