"""One step as a program, and on casadi's virtual machine: the next state, what is sensed there, and its costs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from symphys.codegen import FunctionCall, MemoryLayout, Place, Program
from symphys.expression import Formula
from symphys.model.state_layout import GIVEN, Layout
from symphys.problem import Cost, Problem, Target
from symphys.transcription.feedback.controller_calls import control_calls
from symphys.transcription.program import dense, step_calls
from symphys.transcription.rollout import Rollout
from symphys.types import Array, Expr

Value = Callable[[Formula, int], Expr]
"""The value of a formula at the start (0) or at the end (1) of the step."""
RESULTS = ("after", "sensed", "running", "moments")


class OpenStepPlaces:
    """Where the program keeps one step; see ``Places``."""

    def __init__(self, rollout: Rollout) -> None:
        """Places for a row, and for what comes of it."""
        self.rollout, self.layout = rollout, MemoryLayout()
        nx, nu = int(rollout.x0.shape[0]), int(rollout.given.shape[0])
        self.row, self.smoothing = self.layout.take(sum(row_sizes(rollout))), self.layout.take(1)
        self.x, self.given = self.layout.series(nx, 2), self.layout.take(nu)
        self.u = self.given if rollout.feedback is None else self.layout.series(nu, 1)
        self.p, self.time = self.layout.take(int(rollout.p.shape[0])), self.layout.series(1, 2)
        self.z = self.layout.take(int(rollout.z.shape[0]))

    @property
    def written(self) -> tuple[Place, ...]:
        """The parts of a row, in its order."""
        whole = (self.x.still(), self.given, self.p, self.time.still(), self.time.later().still())
        return (*whole, self.z) if looks_at_variables(self.rollout.problem) else whole


def row_sizes(rollout: Rollout) -> list[int]:
    """Of x, u, p, time, time after and z, which a row of the step's arguments holds; z where costs look at it."""
    nx, nu, np_, n = (int(part.shape[0]) for part in (rollout.x0, rollout.given, rollout.p, rollout.z))
    return [nx, nu, np_, 1, 1, n if looks_at_variables(rollout.problem) else 0]


def looks_at_variables(problem: Problem) -> bool:
    """Whether a cost or target has a variable in its formula."""
    names = {variable.name for variable in problem.variables}
    return any(not names.isdisjoint(each.formula.names) for each in asked(problem))


def asked(problem: Problem) -> list[Cost | Target]:
    """What the objective is made of."""
    return [*problem.costs, *problem.targets]


def moments(problem: Problem) -> tuple[int, ...]:
    """The steps, by number, in which something is asked for at one instant: at their starts, in the last at its end."""
    last = problem.simulation.steps
    instants = {each.at for each in asked(problem) if each.at != "always"}
    return tuple(sorted({last if isinstance(at, str) else round(at / problem.simulation.dt) for at in instants}))


def costs(rollout: Rollout, value: Value) -> tuple[Expr, Expr]:
    """What a step adds to the objective: running costs, and (moments,) what is added if the step has that number.

    Over all steps of a horizon both add up to the objective.
    """
    problem, dt = rollout.problem, rollout.dt
    running: Expr = ca.DM(0)
    ticks = moments(problem)
    single: list[Expr] = [ca.DM(0) for _ in ticks]
    for each in asked(problem):
        squares = each.squares if isinstance(each, Cost) else True
        if each.at == "always":
            shifts = (0, 1) if rollout.moves(each.formula) else (0,)
            for shift in shifts:
                running = running + each.weight * dt / len(shifts) * size(value(each.formula, shift), squares)
        else:
            tick = rollout.tick(each.at)
            found = value(each.formula, 1 if tick == problem.simulation.steps else 0)
            single[ticks.index(tick)] = single[ticks.index(tick)] + each.weight * size(found, squares)
    return running, ca.vertcat(ca.DM(0, 1), *single)


def size(value: Expr, squares: bool) -> Expr:
    """A cost of a value: its square, or itself."""
    return ca.sumsqr(value) if squares else value


def open_program(rollout: Rollout, sensors: Sequence[str], exact: bool) -> Program:
    """The program of one step, whose vector is a row (x, u, p, time, time after, z).

    Its outputs are the next state ``after``, what is sensed there ``sensed``, and the costs ``running`` and
    ``moments``; see ``costs``. ``exact``: for smoothing 0 only.
    """
    places = OpenStepPlaces(rollout)
    body = [*control_calls(rollout, places), *step_calls(places, exact)]
    after, last = places.x.later().still(), list[FunctionCall]()
    sensed = places.layout.take(sensed_size(rollout, sensors))
    inputs = (after, places.p, places.time.later().still())
    last.append(FunctionCall(sense_function(rollout, sensors), inputs, (sensed,)))
    values: dict[tuple[Formula, int], tuple[Expr, Place]] = {}

    def value(formula: Formula, shift: int) -> Expr:
        if (formula, shift) not in values:
            function = dense(rollout.compiled(formula))
            result = places.layout.take(int(function.size1_out(0)))
            x, time = places.x.later(shift).still(), places.time.later(shift).still()
            last.append(FunctionCall(function, (x, places.u.still(), places.p, time, places.z), (result,)))
            values[formula, shift] = ca.SX.sym("value", result.size), result
        return values[formula, shift][0]

    found = [ca.densify(ca.SX(part)) for part in costs(rollout, value)]
    results = tuple(places.layout.take(int(part.shape[0])) for part in found)
    arguments = [symbol for symbol, _ in values.values()]
    last.append(
        FunctionCall(ca.Function("costs", arguments, found), tuple(place for _, place in values.values()), results)
    )
    row = ca.SX.sym("row", places.row.size)
    cuts = np.cumsum([0, *row_sizes(rollout)]).tolist()
    parts = [row[a:b] for a, b in pairwise(cuts)][: len(places.written)]
    first = ca.Function("first", [row], parts)
    outputs = zip(RESULTS, (after, sensed, *results), strict=True)
    return Program(
        size=places.layout.size,
        z=places.row,
        parameters=places.smoothing,
        steps=1,
        outputs={name: place for name, place in outputs if place.size},
        prologue=(FunctionCall(first, (places.row,), places.written),),
        body=tuple(body),
        epilogue=tuple(last),
        zeroed=() if looks_at_variables(rollout.problem) else (places.z,),
    )


def sense_function(rollout: Rollout, sensors: Sequence[str]) -> ca.Function:
    """(x, p, time) -> what these sensors read, one after the other; without any, the states of all bodies."""
    x, p, time = ca.SX.sym("x", rollout.x0.shape[0]), ca.SX.sym("p", rollout.p.shape[0]), ca.SX.sym("time")
    known = {sensor.name: sensor for sensor in rollout.problem.sensors}
    read = [rollout.control.sensor(known[name])(x, p, time) for name in sensors]
    columns = [] if sensors else body_columns(rollout)
    found = ca.vertcat(ca.SX(0, 1), *read, *(x[part] for _, part in columns))
    return ca.Function("sense", [x, p, time], [ca.densify(found)])


def body_columns(rollout: Rollout) -> list[tuple[str, slice]]:
    """Name and columns of the state of each body."""
    layout = Layout(rollout.world)
    return [(f"{body.name}.{key}", layout[f"{body.name}.{key}"]) for body in rollout.world.bodies for key in GIVEN]


def sensed_size(rollout: Rollout, sensors: Sequence[str]) -> int:
    """How many numbers are observed."""
    return int(sense_function(rollout, sensors).size1_out(0))


class VirtualMachineOpenStep:
    """The same on casadi's virtual machine, row by row: for machines without a compiler."""

    doubt = ""

    def __init__(self, rollout: Rollout, sensors: Sequence[str]) -> None:
        """Build the function of one step."""
        sizes = row_sizes(rollout)
        row, smoothing = ca.MX.sym("row", sum(sizes)), ca.MX.sym("smoothing")
        x, given, p, now, later, z = ca.vertsplit(row, np.cumsum([0, *sizes]).tolist())
        z = z if sizes[-1] else ca.MX.zeros(rollout.z.shape[0])
        u = given if rollout.feedback is None else rollout.feedback(x, given, p, now)
        after = rollout.step(x, u, p, smoothing)

        def value(formula: Formula, shift: int) -> Expr:
            return rollout.compiled(formula)(after if shift else x, u, p, later if shift else now, z)

        found = [after, sense_function(rollout, sensors)(after, p, later), *costs(rollout, value)]
        kept = {name: ca.densify(ca.MX(part)) for name, part in zip(RESULTS, found, strict=True) if part.shape[0]}
        self._value = ca.Function("step", [row, smoothing], list(kept.values()))
        self._pull = self._value.reverse(1)
        self.sizes = {name: int(part.shape[0]) for name, part in kept.items()}

    def forward(self, rows: Array, parameters: Sequence[float]) -> Mapping[str, Array]:
        """(B, m) -> results by name, each (B, size)."""
        found = [[np.array(part).ravel() for part in self._value.call([row, parameters[0]])] for row in rows]
        return {name: np.array([each[i] for each in found]) for i, name in enumerate(self.sizes)}

    def gradient(self, rows: Array, seeds: Array, parameters: Sequence[float]) -> tuple[Any, Array]:
        """(B, m), (B, all sizes) -> something, and the slopes (B, m) of seeds . results."""
        cuts, slopes = np.cumsum(list(self.sizes.values()))[:-1], []
        for row, seed in zip(rows, seeds, strict=True):
            values, parts = self._value.call([row, parameters[0]]), np.split(seed, cuts)
            slopes.append(np.array(self._pull.call([row, parameters[0], *values, *parts])[0]).ravel())
        return None, np.array(slopes)
