"""One step as a program: from (x, inputs, p, time) to the next state, what is sensed there, and formulas along the way.

Everything that a problem asks of a rollout is made of these: ``FormulaSamples`` collects the formulas,
``RolloutObjectives`` puts their values together.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from symphys.codegen import FunctionCall, MemoryLayout, Place, Program
from symphys.expression import Formula
from symphys.transcription.decision_variables import start_of
from symphys.transcription.feedback.controller_calls import control_calls
from symphys.transcription.formulas.motion_parts import part_arguments
from symphys.transcription.gradient_probe import combined
from symphys.transcription.objective import plain_sums, terms
from symphys.transcription.program import dense, step_calls
from symphys.transcription.rollout import Rollout
from symphys.types import Expr

RESULTS = ("after", "sensed", "asked", "inputs")


class FormulaSamples:
    """Stands in for a rollout where costs, targets and constraints are put together; see ``Sampled``."""

    def __init__(self, rollout: Rollout) -> None:
        """Nothing is asked for yet."""
        self.rollout, self.problem, self.steps, self.interval = rollout, rollout.problem, rollout.steps, rollout.dt
        self.z = ca.MX.sym("z", rollout.z.shape[0])
        self.p = ca.MX.sym("p", rollout.p.shape[0])
        self.moments: dict[tuple[int, int], tuple[Expr, Expr]] = {}
        self.series: dict[tuple[Formula, int], Expr] = {}

    def at(self, formula: Formula, when: str | float) -> Expr:
        """See ``Sampled``."""
        k = self.rollout.tick(when)
        key = k, min(k, self.steps - 1)
        sizes = self.rollout.x0.shape[0], self.rollout.given.shape[0]
        if key not in self.moments:
            self.moments[key] = ca.MX.sym("x", sizes[0]), ca.MX.sym("u", sizes[1])
        x, u = self.moments[key]
        return self.rollout.compiled(formula)(x, u, self.p, k * self.interval, self.z, *part_arguments(self, formula))

    def after_steps(self, formula: Formula) -> Expr:
        """See ``Sampled``."""
        return self._series(formula, 1)

    def sums(self, samples: Expr, scale: Any = None) -> tuple[Expr, Expr]:
        """See ``Sampled``."""
        return plain_sums(samples, scale)

    def over_steps(self, formula: Formula) -> Expr:
        """See ``Sampled``."""
        before = self._series(formula, 0)
        return ca.horzcat(before, self.after_steps(formula)) if self.rollout.moves(formula) else before

    def _series(self, formula: Formula, shift: int) -> Expr:
        size = int(self.rollout.compiled(formula).size1_out(0))
        return self.series.setdefault((formula, shift), ca.MX.sym("series", size, self.steps))


class RolloutObjectives:
    """What a problem asks of a rollout as functions of (z, p, x and u at moments, series), and their slopes.

    ``value`` gives merit, objective, errors, costs and outputs, ``slopes`` the derivatives of the merit; ``probe`` and
    ``probe_slopes`` are the same of what is differentiated to examine gradients.
    """

    def __init__(self, rollout: Rollout) -> None:
        """Build them."""
        self.samples = FormulaSamples(rollout)
        asked = terms(self.samples)
        self.terms = asked
        merit = asked.objective + asked.penalties
        moments = [symbol for pair in self.samples.moments.values() for symbol in pair]
        self.arguments = [self.samples.z, self.samples.p, *moments, *self.samples.series.values()]
        results = [ca.densify(part) for part in (merit, asked.objective, asked.errors, asked.costs, asked.outputs)]
        self.value = ca.Function("objectives", self.arguments, results)
        self.slopes, number = self._slopes(merit), combined(asked.means)
        self.probe, self.probe_slopes = ca.Function("probe", self.arguments, [number]), self._slopes(number)

    def _slopes(self, number: Expr) -> ca.Function:
        slopes = [ca.densify(ca.gradient(number, symbol)) for symbol in self.arguments]
        return ca.Function("slopes", self.arguments, slopes)


class StepPlaces:
    """Where a program keeps one step; see ``Places``."""

    def __init__(self, rollout: Rollout) -> None:
        """Places for (x, inputs, p, time, time after, z), and for all that comes of it."""
        self.rollout, self.layout = rollout, MemoryLayout()
        sizes = (int(part.shape[0]) for part in (rollout.x0, rollout.given, rollout.p))
        self.nx, self.nu, self.np = sizes
        n = int(rollout.z.shape[0])
        self.all, self.smoothing = self.layout.take(self.nx + self.nu + self.np + 2 + n), self.layout.take(1)
        self.x, self.given = self.layout.series(self.nx, 2), self.layout.take(self.nu)
        self.u = self.given if rollout.feedback is None else self.layout.series(self.nu, 1)
        self.p, self.time, self.z = self.layout.take(self.np), self.layout.series(1, 2), self.layout.take(n)

    @property
    def written(self) -> tuple[Place, ...]:
        """The parts of ``all``, in its order."""
        return (self.x.still(), self.given, self.p, self.time.still(), self.time.later().still(), self.z)


def step_program(rollout: Rollout, objectives: RolloutObjectives, sensors: Sequence[str], exact: bool) -> Program:
    """The program of one step.

    Its vector is (x, inputs, p, time, time after, z). The outputs are the next state ``after``, what the sensors read
    there ``sensed``, the values of the formulas of ``objectives.samples.series`` one after the other ``asked``, and
    ``inputs`` with what small controllers add.
    """
    places = StepPlaces(rollout)
    body = [*control_calls(rollout, places), *step_calls(places, exact)]
    outputs = {"after": places.x.later().still(), "inputs": places.u.still()}
    last: list[FunctionCall] = []
    sensed = [_sense(places, name, last) for name in sensors]
    asked = [_asked(places, formula, shift, last) for formula, shift in objectives.samples.series]
    for name, found in (("sensed", sensed), ("asked", asked)):
        if found:
            outputs[name] = _joined(places, found, last)
    symbols = ca.SX.sym("all", places.all.size)
    sizes = np.cumsum([0, *(place.size for place in places.written)]).tolist()
    first = ca.Function("first", [symbols], [symbols[a:b] for a, b in pairwise(sizes)])
    return Program(
        size=places.layout.size,
        z=places.all,
        parameters=places.smoothing,
        steps=1,
        outputs={name: outputs[name] for name in RESULTS if name in outputs},
        prologue=(FunctionCall(first, (places.all,), places.written),),
        body=tuple(body),
        epilogue=tuple(last),
    )


def _sense(places: StepPlaces, name: str, calls: list[FunctionCall]) -> Place:
    """What a sensor reads in the next state."""
    sensor = next(s for s in places.rollout.problem.sensors if s.name == name)
    result = places.layout.take(sensor.size)
    time = places.time.later().still()
    calls.append(
        FunctionCall(places.rollout.control.sensor(sensor), (places.x.later().still(), places.p, time), (result,))
    )
    return result


def _asked(places: StepPlaces, formula: Formula, shift: int, calls: list[FunctionCall]) -> Place:
    """The value of a formula at the start or at the end of the step."""
    function = dense(places.rollout.compiled(formula))
    result = places.layout.take(int(function.size1_out(0)))
    x, time = places.x.later(shift).still(), places.time.later(shift).still()
    calls.append(FunctionCall(function, (x, places.u.still(), places.p, time, places.z), (result,)))
    return result


def _joined(places: StepPlaces, parts: list[Place], calls: list[FunctionCall]) -> Place:
    """The parts one after the other."""
    symbols = [ca.SX.sym("part", part.size) for part in parts]
    result = places.layout.take(sum(part.size for part in parts))
    calls.append(FunctionCall(ca.Function("joined", symbols, [ca.vertcat(*symbols)]), tuple(parts), (result,)))
    return result


def start_function(rollout: Rollout, sensors: Sequence[str]) -> ca.Function:
    """(z) -> x0, the inputs of all steps one after the other, p, what the sensors read at the start."""
    start = start_of(rollout.problem, rollout.world, rollout.inputs, rollout.parameters, rollout.z)
    x0 = rollout.memory.start(start.x0)
    results = [x0, ca.vec(start.u), start.p, sense_function(rollout, sensors)(x0, start.p, 0.0)]
    return ca.Function("start", [rollout.z], [ca.densify(result) for result in results]).expand()


def sense_function(rollout: Rollout, sensors: Sequence[str]) -> ca.Function:
    """(x, p, time) -> what these sensors read, one after the other."""
    arguments = [ca.MX.sym("x", rollout.x0.shape[0]), ca.MX.sym("p", rollout.p.shape[0]), ca.MX.sym("time")]
    found = [next(s for s in rollout.problem.sensors if s.name == name) for name in sensors]
    read = [rollout.control.sensor(sensor)(*arguments) for sensor in found]
    return ca.Function("sense", arguments, [ca.densify(ca.vertcat(ca.MX(0, 1), *read))])
