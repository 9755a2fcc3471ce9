"""Small shooting problems with known answers, and functions that count how often they are evaluated."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.shooting import Block, ShootingProblem
from symphys.solvers import SOLVERS, Outcome, TraceRow, solver

Array = NDArray[np.float64]
Formula = Callable[[Any, Any], Any]
"""(z, smoothing) -> casadi expression."""
PENALTY = 100.0
TOLERANCE = 1e-9


def toy(
    n: int,
    residuals: Formula | None = None,
    objective: Formula | None = None,
    errors: Formula | None = None,
    constraint: Formula | None = None,
    bounds: tuple[float, float] = (-np.inf, np.inf),
    guess: float = 0.0,
    scale: float = 1.0,
    **more: Any,
) -> ShootingProblem:
    """A problem from formulas; ``constraint`` should be zero and is penalised in the merit."""
    z, s = ca.MX.sym("z", n), ca.MX.sym("s")
    r = residuals(z, s) if residuals else None
    f = ca.sumsqr(r) if residuals else objective(z, s)  # type: ignore[misc]
    c = constraint(z, s) if constraint else ca.MX(0, 1)
    e = ca.vertcat(errors(z, s) if errors else ca.MX(0, 1), ca.fabs(c) / TOLERANCE)
    rows = ca.vertcat(r, np.sqrt(PENALTY) * c) if residuals else None
    merit = f + PENALTY * ca.sumsqr(c)
    zeros = np.zeros(c.numel())
    return ShootingProblem(
        name="toy",
        blocks=(block(n, bounds, guess, scale),),
        value=ca.Function("value", [z, s], [merit, f, e]),
        gradient=ca.Function("gradient", [z, s], [merit, f, e, ca.gradient(merit, z)]),
        residuals=ca.Function("residuals", [z, s], [rows, f, e]) if residuals else None,
        jacobian=ca.Function("jacobian", [z, s], [rows, f, e, ca.jacobian(rows, z)]) if residuals else None,
        nlp=ca.Function("nlp", [z, s], [f, c]),
        constraint_lower=zeros,
        constraint_upper=zeros,
        **more,
    )


def block(n: int, bounds: tuple[float, float], guess: float, scale: float) -> Block:
    """One block of n components."""
    ones = np.ones(n)
    return Block("x", 0, (n, 1), guess * ones, bounds[0] * ones, bounds[1] * ones, scale * ones, 0.1 * ones)


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


def constrained() -> ShootingProblem:
    """Nearest point to (2, 1) on x + y = 1: (1, 0); with the penalty p (1, 0) + (1, 1) / (1 + 2 p)."""
    return toy(2, lambda z, s: z - ca.vertcat(2, 1), constraint=lambda z, s: z[0] + z[1] - 1, stop_when_met=False)


class Arguments:
    """A casadi function's buffer that remembers where its arguments lie."""

    def __init__(self, buffer: Any) -> None:
        self.buffer, self.values = buffer, {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self.buffer, name)

    def set_arg(self, index: int, memory: memoryview) -> None:
        """Pass on."""
        self.values[index] = memory
        self.buffer.set_arg(index, memory)


class Counted:
    """A casadi function that counts its evaluations, keeps the points, and can be made to fail."""

    def __init__(self, function: Any, at: int = 0, error: BaseException | None = None) -> None:
        """Raise ``error`` at the evaluation ``at``."""
        self.function, self.at, self.error, self.count = function, at, error, 0
        self.points: list[Array] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self.function, name)

    def buffer(self) -> tuple[Arguments, Callable[[], None]]:
        """As of the function."""
        inner, evaluate = self.function.buffer()
        buffer = Arguments(inner)

        def counted() -> None:
            self.count += 1
            self.points.append(np.array(buffer.values[0]))
            if self.error and self.count == self.at:
                raise self.error
            evaluate()

        return buffer, counted


def counted(problem: ShootingProblem) -> tuple[ShootingProblem, dict[str, Counted]]:
    """The problem with all its functions counted."""
    names = [name for name in ("value", "gradient", "residuals", "jacobian") if getattr(problem, name)]
    functions = {name: Counted(getattr(problem, name)) for name in names}
    return replace(problem, **functions), functions


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
