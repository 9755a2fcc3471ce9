"""A rollout as symbols, and formulas evaluated along it."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import casadi as ca
import numpy as np

from symphys.dynamics.kept import kept
from symphys.expression import Formula
from symphys.maths.verbatim import verbatim
from symphys.model.world import World
from symphys.problem import ALIVE, Problem, Termination
from symphys.transcription.decision_variables import start_of
from symphys.transcription.feedback.controllers import Control
from symphys.transcription.feedback.sensor_memory import SensorMemory, memory_of
from symphys.transcription.formula_names import (
    Parameters,
    compile_formula,
    input_names,
    moving_names,
    varied_parameters,
)
from symphys.types import Expr


def termination_function(
    problem: Problem,
    termination: Termination,
    world: World,
    inputs: Sequence[str],
    parameters: Parameters,
    memory: SensorMemory,
) -> ca.Function:
    """(x, after, p) -> the next state: ``after`` is all of it but ``alive``, as the step from x has it."""
    margin = compile_formula(problem, world, inputs, parameters, memory, termination.margin)
    x, after = ca.SX.sym("x", memory.size), ca.SX.sym("after", memory.size - 1)
    p = ca.SX.sym("p", margin.size1_in(2))
    blank = [ca.SX.zeros(margin.size1_in(i)) for i in (1, 3, 4)]
    left = margin(ca.vertcat(after, 1), blank[0], p, blank[1], blank[2])
    moved = ca.vertcat(after, left >= 0)
    return ca.Function("termination", [x, after, p], [ca.if_else(x[memory.columns[ALIVE]] > 0, moved, x)])


T = TypeVar("T")


@dataclass(frozen=True)
class Rollout:
    """A problem's rollout as expressions of z and smoothing (MX).

    Attributes:
        problem: what is rolled out.
        world: its numbers, with symbols (SX) for the parameters that variables set.
        inputs: names of the inputs that u stacks.
        parameters: what p stacks.
        memory: what states x hold after those of the world.
        z: (n,) decision vector.
        smoothing: scalar.
        x0: (nx,) initial state.
        given: (nu, N) inputs as variables give them; controllers add to them. Shares of phases are last.
        p: (np,).
        like: a rollout of an equal world under another scheme, whose steps this one's have parts in common with.
    """

    problem: Problem
    world: World
    inputs: tuple[str, ...]
    parameters: Parameters
    memory: SensorMemory
    z: Expr
    smoothing: Expr
    x0: Expr
    given: Expr
    p: Expr

    @property
    def controls(self) -> int:
        """Return how many inputs variables, controllers and laws may set: all but the shares of phases."""
        return int(self.given.shape[0]) - len(self.world.scheduled)

    def with_shares(self, u: Expr, tick: Expr) -> Expr:
        """(nu,): the inputs of a step by its number, from those that may be set."""
        return ca.vertcat(u, self.parameters.phases.at(tick)) if self.world.scheduled else u

    @cached_property
    def step(self) -> ca.Function:
        """One step (x, u, p, smoothing) -> x_next; built when first asked for, since one expression takes its time."""
        from symphys.dynamics.functions import step_function

        return self.remembering(self.built(step_function))

    @cached_property
    def report(self) -> ca.Function:
        """The step with all that happens in it; see ``report_function``."""
        from symphys.dynamics.functions import report_function

        return self.remembering(self.built(report_function))

    @property
    def _shares(self) -> bool:
        """Whether problems of a sweep share what is built."""
        return bool(self.problem.varied) and not self.problem.free_duration and not self.world.scheduled

    def built(self, make: Callable[..., T], *more: Hashable) -> T:
        """Build something from the world; problems of a sweep with equal worlds share it."""
        scheme = self.parameters.scheme(self.problem.simulation)
        arguments = (self.world, scheme, self.inputs, self.parameters.symbols)
        return kept(make, *arguments, *more) if self._shares else make(*arguments, *more)

    def remembering(self, step: ca.Function) -> ca.Function:
        """A function (x, u, p, smoothing) -> (x_next, ...) of the world's state, for states with memory."""
        if self.memory.size == step.size1_in(0):
            return step
        x, u = ca.MX.sym("x", self.memory.size), ca.MX.sym("u", step.size1_in(1))
        p, smoothing = ca.MX.sym("p", step.size1_in(2)), ca.MX.sym("smoothing")
        after, *others = call(step, x[: step.size1_in(0)], u, p, smoothing)
        whole: Expr = ca.vertcat(after, self.memory.after(x, u, self.inputs))
        if self.termination is not None:
            whole = self.termination(x, whole, p)
        with verbatim():
            return ca.Function(step.name(), [x, u, p, smoothing], [whole, *others]).expand()

    @cached_property
    def termination(self) -> ca.Function | None:
        """Return ``termination_function``; None for a problem without termination."""
        problem = self.problem
        if problem.termination is None:
            return None
        return termination_function(problem, problem.termination, self.world, self.inputs, self.parameters, self.memory)

    @cached_property
    def control(self) -> Control:
        """Sensors and controllers."""
        return Control(self.problem, self.world, self.inputs, self.parameters, self.memory)

    @cached_property
    def feedback(self) -> ca.Function | None:
        """(x, u, p, time) -> the inputs of the step from x; None without controllers and force laws."""
        return self.control.function() if self.problem.controllers or self.problem.forces else None

    @cached_property
    def closed(self) -> ca.Function:
        """``step`` with the controllers in it; see ``close``."""
        return self.close(self.step)

    def close(self, step: ca.Function) -> ca.Function:
        """Put the controllers into a step (x, u, p, smoothing) -> (x_next, ...), which then takes [u; time] and adds u.

        Without controllers the second argument is u alone, and u is not among the results.
        """
        if self.feedback is None:
            return step
        x, given = ca.MX.sym("x", self.memory.size), ca.MX.sym("given", step.size1_in(1) + 1)
        p, smoothing = ca.MX.sym("p", step.size1_in(2)), ca.MX.sym("smoothing")
        u = self.feedback(x, given[:-1], p, given[-1])
        results = call(step, x, u, p, smoothing)
        return ca.Function(f"closed_{step.name()}", [x, given, p, smoothing], [*results, u])

    def rolled(self, step: ca.Function) -> tuple[Expr, Expr, list[Expr]]:
        """States (nx, N + 1), inputs (nu, N) and what else a step gives, N columns each; ``step`` is not closed."""
        from symphys.dynamics.functions import roll_out

        given = self.given
        if self.feedback is not None:
            given = ca.vertcat(given, ca.DM(np.arange(self.steps)).T * self.interval)
        x, *others = roll_out(self.close(step), self.steps, self.x0, given, self.p, self.smoothing)
        return (x, self.given, others) if self.feedback is None else (x, others[-1], others[:-1])

    @cached_property
    def _motion(self) -> tuple[Expr, Expr]:
        x, u, _ = self.rolled(self.step)
        return x, u

    @property
    def x(self) -> Expr:
        """(nx, N + 1) states."""
        return self._motion[0]

    @property
    def u(self) -> Expr:
        """(nu, N) inputs."""
        return self.given if self.feedback is None else self._motion[1]

    @property
    def steps(self) -> int:
        """N."""
        return self.problem.simulation.steps

    @property
    def dt(self) -> float:
        """[s] as the file has it."""
        return self.problem.simulation.dt

    @property
    def interval(self) -> Expr:
        """[s] the time step: ``dt``, or an expression of z where a variable sets the duration."""
        return self.parameters.step_length(self.problem.simulation, self.p)

    def compiled(self, formula: Formula) -> ca.Function:
        """The formula as a casadi function of (x, u, p, time, z), and of its parts, one after the other."""
        return compile_formula(self.problem, self.world, self.inputs, self.parameters, self.memory, formula)

    def tick(self, when: str | float) -> int:
        """The number of the state at the end, or nearest to a time [s]."""
        return self.steps if isinstance(when, str) else round(when / self.dt)

    def sampled(self, formula: Formula, shift: int) -> Expr:
        """Return the values (m, N) of a formula at the starts (0) or ends (1) of all steps, with each step's inputs."""
        return self.sampled_along(formula, shift, self.x, self.u, self.p, self.z)

    def sampled_along(self, formula: Formula, shift: int, x: Expr, u: Expr, p: Expr, z: Expr) -> Expr:
        """Return ``sampled`` of other states (nx, N + 1), inputs (nu, N), parameters (np,) and decision vector (n,)."""
        ticks, interval = np.arange(shift, self.steps + shift), self.parameters.step_length(self.problem.simulation, p)
        named = any(variable.name in formula.names for variable in self.problem.variables)
        shared = ca.repmat(z, 1, self.steps) if named else ca.DM(z.shape[0], self.steps)
        given = (x[:, shift : self.steps + shift], u, ca.repmat(p, 1, self.steps), ca.DM(ticks).T * interval, shared)
        return self.compiled(formula).map(self.steps)(*given)

    def moves(self, formula: Formula) -> bool:
        """Whether the formula depends on what changes within a step."""
        return not self._moving.isdisjoint(formula.names)

    @cached_property
    def _moving(self) -> frozenset[str]:
        return moving_names(self.world).union(*(each.names for each in self.problem.references))


def symbolic_rollout(problem: Problem, inputs: tuple[str, ...] | None = None, asked: Iterable[Formula] = ()) -> Rollout:
    """The rollout of a problem over its horizon; ``inputs`` may name more than the problem itself makes use of.

    ``asked``: formulas that will be evaluated along it beside those of the problem.
    """
    parameters = varied_parameters(problem)
    scheduled = tuple((share.name, share.symbol) for share in parameters.phases.shares)
    inputs = (*(input_names(problem) if inputs is None else inputs), *(name for name, _ in scheduled))
    world = replace(problem.world(parameters.overrides()), scheduled=scheduled)
    z = ca.MX.sym("z", sum(v.guess.size for v in problem.variables))
    smoothing = ca.MX.sym("smoothing")
    start, memory = start_of(problem, world, inputs, parameters, z), memory_of(problem, world, inputs, asked)
    return Rollout(problem, world, inputs, parameters, memory, z, smoothing, memory.start(start.x0), start.u, start.p)


def call(function: ca.Function, *arguments: Expr) -> list[Expr]:
    """All results of a call."""
    results = function(*arguments)
    return list(results) if isinstance(results, tuple) else [results]
