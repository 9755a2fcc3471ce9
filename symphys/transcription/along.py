"""A rollout as symbols, and formulas evaluated along it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from symphys.expression import Formula
from symphys.problem import Problem
from symphys.rollout import roll_out
from symphys.step import step_function
from symphys.transcription.decision import start_of
from symphys.transcription.names import Parameters, compile_formula, input_names, moving_names, varied_parameters
from symphys.world import World

Expr = Any
"""casadi MX"""


@dataclass(frozen=True)
class Rollout:
    """A problem's rollout as expressions of z and smoothing (MX).

    Attributes:
        problem: what is rolled out.
        world: its numbers, with symbols (SX) for the parameters that variables set.
        inputs: names of the inputs that u stacks.
        parameters: what p stacks.
        z: (n,) decision vector.
        smoothing: scalar.
        x0: (nx,) initial state.
        u: (nu, N).
        p: (np,).
    """

    problem: Problem
    world: World
    inputs: tuple[str, ...]
    parameters: Parameters
    z: Expr
    smoothing: Expr
    x0: Expr
    u: Expr
    p: Expr

    @cached_property
    def step(self) -> ca.Function:
        """One step (x, u, p, smoothing) -> x_next; built when first asked for, since one expression takes its time."""
        scheme = self.problem.simulation.scheme()
        return step_function(self.world, scheme, self.inputs, self.parameters.symbols)

    @cached_property
    def x(self) -> Expr:
        """(nx, N + 1) states."""
        (x,) = roll_out(self.step, self.steps, self.x0, self.u, self.p, self.smoothing)
        return x

    @property
    def steps(self) -> int:
        """N."""
        return self.problem.simulation.steps

    @property
    def dt(self) -> float:
        """[s]."""
        return self.problem.simulation.dt

    def compiled(self, formula: Formula) -> ca.Function:
        """The formula as a casadi function of (x, u, p, time, z)."""
        n = int(self.z.shape[0])
        return compile_formula(self.problem, self.world, self.inputs, self.parameters, formula, n)

    def tick(self, when: str | float) -> int:
        """The number of the state at the end, or nearest to a time [s]."""
        return self.steps if isinstance(when, str) else round(when / self.dt)

    def at(self, formula: Formula, when: str | float) -> Expr:
        """(m,): the formula's value at the end or at the step nearest to a time; inputs are those of that step."""
        k = self.tick(when)
        u = self.u[:, min(k, self.steps - 1)]
        return self.compiled(formula)(self.x[:, k], u, self.p, k * self.dt, self.z)

    def after_steps(self, formula: Formula) -> Expr:
        """(m, N): its value at the end of every step, with that step's inputs."""
        return self._mapped(formula, self.x[:, 1:], np.arange(1, self.steps + 1))

    def over_steps(self, formula: Formula) -> Expr:
        """(m, N or 2N): samples whose mean is the time average; 2N for what moves (trapezoid)."""
        before = self._mapped(formula, self.x[:, :-1], np.arange(self.steps))
        if not self.moves(formula):
            return before
        return ca.horzcat(before, self.after_steps(formula))

    def _mapped(self, formula: Formula, x: Expr, ticks: Any) -> Expr:
        stage = self.compiled(formula).map(self.steps)
        p, z = ca.repmat(self.p, 1, self.steps), self.z
        shared = ca.repmat(z, 1, self.steps) if self._uses_z(formula) else ca.DM(z.shape[0], self.steps)
        return stage(x, self.u, p, ca.DM(ticks * self.dt).T, shared)

    def moves(self, formula: Formula) -> bool:
        """Whether the formula depends on what changes within a step."""
        return not self._moving.isdisjoint(formula.names)

    @cached_property
    def _moving(self) -> frozenset[str]:
        return moving_names(self.world)

    def _uses_z(self, formula: Formula) -> bool:
        return any(variable.name in formula.names for variable in self.problem.variables)


def symbolic_rollout(problem: Problem) -> Rollout:
    """The rollout of a problem over its horizon."""
    parameters, inputs = varied_parameters(problem), input_names(problem)
    world = problem.world(_overrides(parameters))
    z = ca.MX.sym("z", sum(v.guess.size for v in problem.variables))
    smoothing = ca.MX.sym("smoothing")
    start = start_of(problem, world, inputs, parameters, z)
    return Rollout(problem, world, inputs, parameters, z, smoothing, start.x0, start.u, start.p)


def _overrides(parameters: Parameters) -> dict[str, Any]:
    return dict(zip(parameters.names, parameters.symbols, strict=True))
