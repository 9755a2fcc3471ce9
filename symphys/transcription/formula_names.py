"""The values of a formula's names at one instant of a rollout, and the symbols that stand for them.

Phases may set numbers of the world. A step has one value of each number. Its inputs hold a share for each phase that
sets something, 1 in the steps of the phase and 0 in others, and a number is base + sum of share (own - base). Impulses
of constraints cover half of the substep before as well (docs/time_step.md, equation 2), so that where they are bounded
by a number, as friction is, the first step has that part of its share from the step before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np

from symphys.dynamics.observation import SensedState, named_sensors, sensor_readings
from symphys.expression import Formula
from symphys.model.state_layout import input_columns, input_sizes, input_symbols
from symphys.model.world import Scheme, World
from symphys.problem import ALIVE, STEP_LENGTH, Problem, Simulation, Variable, placing
from symphys.problem.references import reference_values
from symphys.records import dataclass
from symphys.transcription.sensor_memory import SensorMemory
from symphys.types import Array, Expr

STEP_MARGIN = 0.25
"""Share of a step by which times are shifted from its ends, so that rounding does not select another step."""


@dataclass(frozen=True)
class PhaseShare:
    """The share of a phase in a step.

    Attributes:
        name: of the input.
        symbol: SX, that stands for it in a world.
        ticks: the numbers of its first and last state.
        before: how much of a step counts as the step before it.
    """

    name: str
    symbol: Expr
    ticks: tuple[int, int]
    before: float

    def at(self, tick: Expr) -> Expr:
        """Return the share in the step of this number."""
        now = self._within(tick)
        return (1 - self.before) * now + self.before * self._within(ca.fmax(tick - 1, 0)) if self.before else now

    def _within(self, tick: Expr) -> Expr:
        first, last = (end - STEP_MARGIN for end in self.ticks)
        return ca.logic_and(tick > first, tick < last)


@dataclass(frozen=True)
class PhaseNumbers:
    """Parameters that phases set.

    Attributes:
        shares: of the phases that set something, one or two each.
        sets: by the name of a parameter, the names of the numbers that stand for it, with their shares.
        nominal: the numbers of the file.
    """

    shares: tuple[PhaseShare, ...] = ()
    sets: Mapping[str, tuple[tuple[str, PhaseShare], ...]] = field(default_factory=dict)
    nominal: Mapping[str, Array] = field(default_factory=dict)

    def at(self, ticks: Expr) -> Expr:
        """Return (shares, N) of the steps with these numbers (1, N)."""
        return ca.vertcat(type(ticks)(0, ticks.shape[1]), *(share.at(ticks) for share in self.shares))

    def values(self, known: Mapping[str, Expr]) -> dict[str, Expr]:
        """Return parameters as expressions (SX) in a step; ``known``: those that are symbols of p."""
        found = {}
        for name, parts in self.sets.items():
            base = known.get(name, ca.DM(self.nominal[name]))
            found[name] = ca.SX(base) + sum(share.symbol * (known[own] - base) for own, share in parts)
        return found


def phase_numbers(problem: Problem) -> PhaseNumbers:
    """Return the numbers that the phases of a problem set."""
    setting = [phase for phase in problem.phases if phase.sets]
    if not setting:
        return PhaseNumbers()
    from symphys.dynamics.step import max_splits  # late: the physics of a step, which few problems need here

    simulation, shares = problem.simulation, dict[tuple[str, bool], PhaseShare]()
    before = 0.5 / (1 + max_splits(problem.world(), simulation.scheme()))
    sets: dict[str, list[tuple[str, PhaseShare]]] = {}
    for phase in setting:
        for name in phase.sets:
            late = problem.parametric.numbers[name].phase == "impulse"
            if (phase.name, late) not in shares:
                called = f"{phase.name}.{'share_of_impulses' if late else 'share'}"
                ticks = phase.ticks(simulation.steps)
                shares[phase.name, late] = PhaseShare(called, ca.SX.sym(called), ticks, before if late else 0.0)
            sets.setdefault(name, []).append((f"{phase.name}.{name}", shares[phase.name, late]))
    nominal = {name: problem.parameters[name] for name in sets}
    return PhaseNumbers(tuple(shares.values()), {name: tuple(parts) for name, parts in sets.items()}, nominal)


@dataclass(frozen=True)
class Instant:
    """The arguments that a formula may depend on, SX: state, inputs, parameters, time, all of z."""

    x: Expr
    u: Expr
    p: Expr
    time: Expr
    z: Expr

    def arguments(self) -> list[Expr]:
        """Return the symbols in the order of the arguments of compiled formulas."""
        return [self.x, self.u, self.p, self.time, self.z]


@dataclass(frozen=True)
class Parameters:
    """The entries of p: physical parameters that variables set, numbers of feedback, the time step if it varies.

    Attributes:
        names: in the order of p.
        symbols: SX, one column each.
        nominal: their values in the file.
        physical: how many of them are physical.
        phases: the numbers of the world that change from step to step.
    """

    names: tuple[str, ...]
    symbols: tuple[Expr, ...]
    nominal: tuple[Expr, ...]
    physical: int
    phases: PhaseNumbers = field(default_factory=PhaseNumbers)

    @cached_property
    def columns(self) -> dict[str, slice]:
        """Map each parameter to its columns of p."""
        ends = np.cumsum([0, *(symbol.shape[0] for symbol in self.symbols)]).tolist()
        return {name: slice(*part) for name, part in zip(self.names, pairwise(ends), strict=True)}

    def overrides(self) -> dict[str, Expr]:
        """Map physical parameters to their expressions in a step, phases included."""
        found = dict(zip(self.names, self.symbols, strict=True))
        return {name: found[name] for name in self.names[: self.physical]} | self.phases.values(found)

    def step_length(self, simulation: Simulation, p: Expr) -> Expr:
        """Return the time step [s]: a number, or an entry of ``p`` (np,), as with a free duration."""
        return p[self.columns[STEP_LENGTH]] if STEP_LENGTH in self.columns else simulation.dt

    def scheme(self, simulation: Simulation) -> Scheme:
        """Return the scheme of a step; ``dt`` is an expression of the symbols where the duration or it is one."""
        return replace(simulation.scheme(), dt=self.step_length(simulation, ca.vertcat(ca.SX(0, 1), *self.symbols)))


def varied_parameters(problem: Problem, timed: bool = False) -> Parameters:
    """Return the parameters that variables set, in order of first mention, and all numbers of feedback.

    Feedback is controllers, force laws and phases. Of a problem of a sweep also those in which it differs from others,
    so that they share what is built. The time step is the last one if ``timed``, or where the duration is free.
    """
    own = dict.fromkeys(slot.name for v in problem.variables if v.kind == "parameter" for slot in v.slots)
    names = (*own, *(name for name in swept_parameters(problem) if name not in own))
    values = {name: problem.parameters[name] for name in names} | problem.weights
    if timed or problem.free_duration:
        values |= {STEP_LENGTH: np.array([problem.simulation.dt])}
    nominal = tuple(ca.DM(value) for value in values.values())
    symbols = tuple(ca.SX.sym(name, value.shape[0]) for name, value in zip(values, nominal, strict=True))
    return Parameters(tuple(values), symbols, nominal, len(names), phase_numbers(problem))


def swept_parameters(problem: Problem) -> list[str]:
    """Return the parameters that differ in a sweep, except those that set where bodies start."""
    names = problem.varied & problem.parameters.keys()
    return sorted(names.difference(placing(names)))


def input_names(problem: Problem) -> tuple[str, ...]:
    """Return forces, torques and commands that variables, controllers or force laws set, in that order."""
    set_ = [slot.name for v in problem.variables if v.kind == "control" for slot in v.slots]
    driven = [name for controller in problem.controllers for name, _ in controller.drives]
    acted = [name for law in problem.forces for name, _, _ in law.acts_on]
    return tuple(dict.fromkeys([*set_, *driven, *acted]))


def instant(world: World, inputs: Sequence[str], parameters: Parameters, memory: SensorMemory, n: int) -> Instant:
    """Make symbols for all arguments of a formula; ``n``: length of z."""
    return Instant(
        ca.SX.sym("x", memory.size),
        input_symbols(world, inputs),
        ca.vertcat(ca.SX(0, 1), *parameters.symbols),
        ca.SX.sym("time"),
        ca.SX.sym("z", n),
    )


def compile_formula(
    problem: Problem,
    world: World,
    inputs: Sequence[str],
    parameters: Parameters,
    memory: SensorMemory,
    formula: Formula,
) -> ca.Function:
    """Make a formula a casadi function of (x, u, p, time, z); x with its memory.

    What a formula takes of a whole motion is one more argument at the end: its parts, one after the other.
    """
    at = instant(world, inputs, parameters, memory, sum(v.guess.size for v in problem.variables))
    names = namespace(problem, world, inputs, parameters, memory, at, formula.names)
    for variable, (start, stop) in zip(problem.variables, spans(problem.variables), strict=True):
        names[variable.name] = at.z[start:stop]
        if variable.kind == "control":
            names[now(variable.name)] = _acting(world, inputs, variable, at.u)
    arguments, parts = at.arguments(), []
    for part in formula.parts:
        size = compile_formula(problem, world, inputs, parameters, memory, part.formula).size1_out(0)
        names[part.name] = ca.SX.sym("part", size)
        parts.append(names[part.name])
    value = formula.evaluate({name: names[name] for name in formula.names})
    return ca.Function("formula", [*arguments, *([ca.vertcat(*parts)] if parts else [])], [ca.SX(value)])


def now(name: str) -> str:
    """Return the name of a control variable's value at one instant; its own name stands for all of its knots."""
    return f"{name} now"


def _acting(world: World, inputs: Sequence[str], variable: Variable, u: Expr) -> Expr:
    """Return (components,) the value of a control variable at an instant whose inputs are ``u``."""
    slot = variable.slots[0]
    return u[input_columns(world, inputs)[slot.name]][list(slot.components)]


def namespace(
    problem: Problem,
    world: World,
    inputs: Sequence[str],
    parameters: Parameters,
    memory: SensorMemory,
    at: Instant,
    wanted: frozenset[str],
) -> dict[str, Expr]:
    """Map names, except those of variables, to expressions at an instant; costly ones only if wanted."""
    dt = parameters.step_length(problem.simulation, at.p)
    names: dict[str, Expr] = {"time": at.time, "duration": ca.SX(dt * problem.simulation.steps)}
    if memory.terminates:
        names[ALIVE] = at.x[memory.columns[ALIVE]]
    names.update({name: ca.SX.zeros(size) for name, size in input_sizes(world).items()})
    names.update({name: at.u[part] for name, part in input_columns(world, inputs).items()})
    names.update({name: ca.DM(value) for name, value in problem.parameters.items()})
    names.update(zip(parameters.names, parameters.symbols, strict=True))
    names.update(parameters.overrides())
    followed = [each for each in problem.references if not wanted.isdisjoint(each.names)]
    names.update(reference_values(followed, at.time, names))
    never = {name: ca.SX.zeros(size) for name, size in input_sizes(world).items() if name not in inputs}
    names.update(sensor_readings(SensedState(world, at.x, never | memory.before(at.x), dt), wanted))
    return names


def moving_names(world: World) -> frozenset[str]:
    """Return the names that change within a step."""
    return frozenset({"time", ALIVE, *named_sensors(world)})


def spans(variables: Sequence[Variable]) -> list[tuple[int, int]]:
    """Return (start, stop) of each variable in z."""
    result, start = [], 0
    for variable in variables:
        result.append((start, start + variable.guess.size))
        start += variable.guess.size
    return result
