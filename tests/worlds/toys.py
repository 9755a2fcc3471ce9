"""Small shooting problems with known answers, and evaluators that count."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
import pytest

from symphys.codegen import FunctionCall, KernelUnavailable, MemoryLayout, Program
from symphys.codegen.backends import BackendSource, choose
from symphys.codegen.toolchain.compiler import find_compiler
from symphys.shooting import Evaluator, ShootingProblem, Values, VariableBlock
from symphys.solvers import SOLVERS, Outcome, TraceRow, solver
from symphys.types import Array

OTHERS = ("ilqr", "multiple_shooting", "race")
PLAIN = [name for name, each in SOLVERS.items() if not each.scenarios and name not in OTHERS]
"""The solvers that need neither a scenario nor steps; each of the others has tests of its own."""

Formula = Callable[[Any, Any], Any]
"""(z, smoothing) -> casadi expression."""
PENALTY = 100.0
TOLERANCE = 1e-9


@dataclass(frozen=True)
class ToyFunctions:
    """See ``symphys.codegen.backends.Functions``."""

    value: Any
    gradient: Any
    residuals: Any
    jacobian: Any
    nlp: Any


def toy(
    n: int,
    residuals: Formula | None = None,
    objective: Formula | None = None,
    errors: Formula | None = None,
    constraint: Formula | None = None,
    bounds: tuple[float, float] = (-np.inf, np.inf),
    guess: float = 0.0,
    scale: float = 1.0,
    backend: str = "casadi",
    outputs: bool = False,
    **more: Any,
) -> ShootingProblem:
    """A problem from formulas; ``constraint`` should be zero and is penalised in the merit.

    ``outputs``: it has one, the sum of z.
    """
    z, s = ca.MX.sym("z", n), ca.MX.sym("s")
    r = residuals(z, s) if residuals else None
    f = ca.sumsqr(r) if residuals else objective(z, s)  # type: ignore[misc]
    c = constraint(z, s) if constraint else ca.MX(0, 1)
    e = ca.vertcat(errors(z, s) if errors else ca.MX(0, 1), ca.fabs(c) / TOLERANCE)
    rows = ca.vertcat(r, np.sqrt(PENALTY) * c) if residuals else None
    o = ca.sum1(z) if outputs else ca.MX(0, 1)
    merit = f + PENALTY * ca.sumsqr(c)
    functions = ToyFunctions(
        value=ca.Function("value", [z, s], [merit, f, e, o]),
        gradient=ca.Function("gradient", [z, s], [merit, f, e, ca.gradient(merit, z), o]),
        residuals=ca.Function("residuals", [z, s], [rows, f, e, o]) if residuals else None,
        jacobian=ca.Function("jacobian", [z, s], [rows, f, e, ca.jacobian(rows, z), o]) if residuals else None,
        nlp=ca.Function("nlp", [z, s], [f, c]),
    )
    named = {"merit": merit, "objective": f, "errors": e, "constraints": c, "residuals": rows, "outputs": o}
    chosen = choose(backend, BackendSource(functions, lambda: program(z, s, named)))
    zeros = np.zeros(c.numel())
    return ShootingProblem(
        name="toy",
        blocks=(block(n, bounds, guess, scale),),
        evaluator=chosen.evaluator,
        nlp=chosen.nlp,
        squares=residuals is not None,
        constraint_lower=zeros,
        constraint_upper=zeros,
        limits=range(e.numel() - c.numel(), e.numel()),
        output_names=("sum [m]",) if outputs else (),
        **more,
    )


def require(backend: str) -> None:
    """Skip where a backend cannot be built."""
    try:
        if backend != "casadi":
            find_compiler()
    except KernelUnavailable as error:
        pytest.skip(str(error))


def program(z: Any, s: Any, named: dict[str, Any]) -> Program:
    """The toy as one call."""
    parts = {name: ca.densify(part) for name, part in named.items() if part is not None and part.numel()}
    layout = MemoryLayout()
    inputs = (layout.take(z.numel()), layout.take(1))
    outputs = {name: layout.take(part.numel()) for name, part in parts.items()}
    function = ca.Function("toy", [z, s], list(parts.values())).expand()
    call = FunctionCall(function, inputs, tuple(outputs.values()))
    return Program(layout.size, *inputs, steps=0, outputs=outputs, epilogue=(call,))


def block(n: int, bounds: tuple[float, float], guess: float, scale: float) -> VariableBlock:
    """One block of n components."""
    ones = np.ones(n)
    return VariableBlock("x", 0, (n, 1), guess * ones, bounds[0] * ones, bounds[1] * ones, scale * ones, 0.1 * ones)


def quadratic(**more: Any) -> ShootingProblem:
    """Minimum 0 at (1, 2, 3)."""
    return toy(3, lambda z, s: ca.vertcat(z[0] - 1, 2 * (z[1] - 2), 3 * (z[2] - 3)), **more)


def rosenbrock(**more: Any) -> ShootingProblem:
    """Minimum 0 at (1, 1), by a bent valley."""
    return toy(2, lambda z, s: ca.vertcat(1 - z[0], 10 * (z[1] - z[0] ** 2)), guess=-1.0, **more)


def target(**more: Any) -> ShootingProblem:
    """Met where both components are within 1e-3 of (2, -1)."""

    def miss(z: Any, s: Any) -> Any:
        return ca.vertcat(z[0] + 0.1 * z[1] ** 2 - 2.1, ca.sinh(z[1]) - np.sinh(-1))

    return toy(2, miss, errors=lambda z, s: ca.fabs(miss(z, s)) / 1e-3, **more)


def constrained(**more: Any) -> ShootingProblem:
    """Nearest point to (2, 1) on x + y = 1: (1, 0); with the penalty p (1, 0) + (1, 1) / (1 + 2 p)."""
    return toy(
        2, lambda z, s: z - ca.vertcat(2, 1), constraint=lambda z, s: z[0] + z[1] - 1, stop_when_met=False, **more
    )


class Counted:
    """An evaluator that counts the rows that it evaluates by kind, keeps them, and can be made to fail."""

    def __init__(self, evaluator: Evaluator, kinds: Iterable[str] = (), at: int = 0, error: Any = None) -> None:
        """Raise ``error`` at the row number ``at`` of one of the kinds."""
        self.evaluator, self.kinds, self.at, self.error = evaluator, tuple(kinds), at, error
        self.count, self.calls = Counter[str](), Counter[str]()
        self.points: list[Array] = []

    def evaluate(self, kind: str, Z: Array, smoothing: float) -> Values:
        """Count and pass on."""
        before = self.count[kind]
        self.calls[kind] += 1
        self.count[kind] += len(Z)
        self.points += list(Z)
        if kind in self.kinds and before < self.at <= self.count[kind]:
            raise self.error
        values: Values = getattr(self.evaluator, kind)(Z, smoothing)
        return values

    def value(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return self.evaluate("value", Z, smoothing)

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return self.evaluate("gradient", Z, smoothing)

    def residuals(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return self.evaluate("residuals", Z, smoothing)

    def jacobian(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return self.evaluate("jacobian", Z, smoothing)


def counted(problem: ShootingProblem) -> tuple[ShootingProblem, Counted]:
    """The problem with its evaluations counted."""
    evaluator = Counted(problem.evaluator)
    return replace(problem, evaluator=evaluator), evaluator


def failing(problem: ShootingProblem, kinds: Iterable[str], at: int, error: BaseException) -> ShootingProblem:
    """The problem with an evaluation that raises."""
    return replace(problem, evaluator=Counted(problem.evaluator, kinds, at, error))


def values(problem: ShootingProblem, z: Any, smoothing: float = 0.0) -> Values:
    """At one z."""
    return problem.evaluator.value(np.array([z], float), smoothing)


def solve(name: str, problem: ShootingProblem, seed: int = 0, options: Any = None, **more: Any) -> Outcome:
    """With the solver's default options unless given as a dict."""
    chosen = SOLVERS[name].Options(**(options or {}))
    return solver(name).solve(problem, problem.start(seed), chosen, seed, **more)


def stop_at(iteration: int) -> Callable[[TraceRow], None]:
    """A monitor that interrupts there."""

    def monitor(row: TraceRow) -> None:
        if row.iteration == iteration:
            raise KeyboardInterrupt

    return monitor


def through_json(checkpoint: dict[str, object]) -> dict[str, Any]:
    """As a file would give it back: numbers that are not finite as text."""

    def strict(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: strict(each) for key, each in value.items()}
        if isinstance(value, list):
            return [strict(each) for each in value]
        return value if not isinstance(value, float) or np.isfinite(value) else repr(value)

    result: dict[str, Any] = json.loads(json.dumps(strict(checkpoint), allow_nan=False))
    return result
