"""What a problem asks of a rollout, as functions of the values of its formulas along the way."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from symphys.transcription.decision_variables import start_of
from symphys.transcription.gradient_probe import combined
from symphys.transcription.objective import FormulaSamples, terms
from symphys.transcription.rollout import Rollout
from symphys.transcription.stage import Stage, Value, sense_function
from symphys.types import Expr


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
        self.arguments = self.samples.symbols
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
    """Z -> x0, the inputs of all steps one after the other, p, what the sensors read at the start, the time step."""
    start = start_of(rollout.problem, rollout.world, rollout.inputs, rollout.parameters, rollout.z)
    x0 = rollout.memory.start(start.x0)
    interval = rollout.parameters.step_length(rollout.problem.simulation, start.p)
    results = [x0, ca.vec(start.u), start.p, sense_function(rollout, sensors)(x0, start.p, 0.0), ca.MX(interval)]
    return ca.Function("start", [rollout.z], [ca.densify(result) for result in results]).expand()
