"""The transcription: one rollout expression, cut into the functions that solvers, judges and recorders call."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.problem import Problem
from symphys.shooting import ShootingProblem
from symphys.trajectory import Trajectory
from symphys.transcription.along import Rollout, symbolic_rollout
from symphys.transcription.decision import blocks
from symphys.transcription.judge import Verdict, verdict
from symphys.transcription.simulate import recorder, simulate
from symphys.transcription.terms import Terms, terms

Array = NDArray[np.float64]
Judge = Callable[[Array], Verdict]
PRICING_CALLS = 5
"""How often a function is timed; the fastest call counts."""


@dataclass(frozen=True)
class Transcription:
    """A problem, its shooting problem, and the exact rollout that judges and records."""

    problem: Problem
    rollout: Rollout
    terms: Terms
    shooting: ShootingProblem
    build_seconds: float

    def judge(self, z: Array) -> Verdict:
        """How ``z`` does in the exact rollout."""
        return self._judge(z)

    def simulate(self, z: Array, smoothing: float = 0.0) -> Trajectory:
        """The motion; NotFinite if there is none."""
        return simulate(self.rollout, self._recorder, z, smoothing)

    def prices(self, kinds: Iterable[str] = ("gradient", "jacobian")) -> dict[str, float]:
        """Measured cost of one "gradient", "jacobian" or "hessian" in rollouts, at the guess."""
        z = self.shooting.start(0)
        one = _fastest(self.shooting.value, z)
        functions = {kind: self._priced(kind) for kind in kinds}
        return {kind: _fastest(f, z) / one for kind, f in functions.items() if f is not None}

    def _priced(self, kind: str) -> ca.Function | None:
        if kind == "hessian":
            return self._hessian
        return self.shooting.jacobian if kind == "jacobian" else self.shooting.gradient

    @cached_property
    def _judge(self) -> Judge:
        return judge_of(self.rollout, self.terms)

    @cached_property
    def _recorder(self) -> ca.Function:
        return recorder(self.rollout)

    @cached_property
    def _hessian(self) -> ca.Function:
        return _function(self.rollout, "hessian", [ca.hessian(self.terms.objective, self.rollout.z)[0]])


def judge_of(rollout: Rollout, asked: Terms) -> Judge:
    """A judge of candidates by the exact rollout, without the functions that solvers need."""
    numbers = _function(rollout, "judge", [asked.objective, asked.costs, asked.errors])

    def judge(z: Array) -> Verdict:
        objective, costs, errors = numbers(z, 0.0)
        return verdict(rollout.problem, float(objective), np.array(costs).ravel(), np.array(errors).ravel())

    return judge


def judge_for(problem: Problem) -> Judge:
    """The judge of a problem."""
    rollout = symbolic_rollout(problem)
    return judge_of(rollout, terms(rollout))


def transcribe(problem: Problem) -> Transcription:
    """Build everything that solving, judging and recording this problem needs."""
    began = perf_counter()
    rollout = symbolic_rollout(problem)
    asked = terms(rollout)
    shooting = _shooting(problem, rollout, asked)
    return Transcription(problem, rollout, asked, shooting, perf_counter() - began)


def _shooting(problem: Problem, rollout: Rollout, asked: Terms) -> ShootingProblem:
    merit = asked.objective + asked.penalties
    common = [asked.objective, asked.errors]
    squares, r = {}, asked.residuals
    if r is not None and r.shape[0]:
        squares["residuals"] = _function(rollout, "residuals", [r, *common])
        squares["jacobian"] = _function(rollout, "jacobian", [r, *common, ca.jacobian(r, rollout.z)])
    return ShootingProblem(
        name=problem.name,
        blocks=blocks(problem),
        value=_function(rollout, "value", [merit, *common]),
        gradient=_function(rollout, "gradient", [merit, *common, ca.gradient(merit, rollout.z)]),
        residuals=squares.get("residuals"),
        jacobian=squares.get("jacobian"),
        nlp=_function(rollout, "nlp", [asked.objective, asked.constraints]),
        constraint_names=asked.names,
        constraint_lower=asked.lower,
        constraint_upper=asked.upper,
        smoothing=problem.simulation.smoothing,
        stop_when_met=problem.stop_when_met,
    )


def _function(rollout: Rollout, name: str, outputs: list[Any]) -> ca.Function:
    return ca.Function(name, [rollout.z, rollout.smoothing], [ca.densify(output) for output in outputs])


def _fastest(function: ca.Function, z: Array) -> float:
    """Seconds of the fastest of a few calls."""
    times = []
    for _ in range(PRICING_CALLS):
        began = perf_counter()
        function(z, 0.0)
        times.append(perf_counter() - began)
    return min(times)
