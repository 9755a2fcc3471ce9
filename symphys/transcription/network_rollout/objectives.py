"""What a problem asks of a rollout, of the values of its formulas along the way.

``FormulaSamples`` collects the formulas, ``RolloutObjectives`` puts their values together.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.expression import Formula
from symphys.transcription.decision_variables import start_of
from symphys.transcription.formulas.motion_parts import part_arguments
from symphys.transcription.gradient_probe import combined
from symphys.transcription.objective import plain_sums, terms
from symphys.transcription.rollout import Rollout
from symphys.transcription.stage import Stage, Value, sense_function
from symphys.types import Expr


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

    def stage(self, rollout: Rollout, sensors: Sequence[str]) -> Stage:
        """A step; ``asked`` are the values of the formulas of ``samples.series``, one after the other."""

        def ask(value: Value) -> dict[str, Expr]:
            return {"asked": ca.vertcat(ca.SX(0, 1), *(value(*each) for each in self.samples.series))}

        return Stage(rollout, sense_function(rollout, sensors), ask, shows_inputs=True)

    def _slopes(self, number: Expr) -> ca.Function:
        slopes = [ca.densify(ca.gradient(number, symbol)) for symbol in self.arguments]
        return ca.Function("slopes", self.arguments, slopes)


def start_function(rollout: Rollout, sensors: Sequence[str]) -> ca.Function:
    """(z) -> x0, the inputs of all steps one after the other, p, what the sensors read at the start."""
    start = start_of(rollout.problem, rollout.world, rollout.inputs, rollout.parameters, rollout.z)
    x0 = rollout.memory.start(start.x0)
    results = [x0, ca.vec(start.u), start.p, sense_function(rollout, sensors)(x0, start.p, 0.0)]
    return ca.Function("start", [rollout.z], [ca.densify(result) for result in results]).expand()
