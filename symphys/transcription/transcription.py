"""What solving, judging and recording a problem needs, in one object."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.backends import Description
from symphys.problem import Problem
from symphys.shooting import ShootingProblem
from symphys.trajectory import Trajectory
from symphys.transcription.along import Rollout
from symphys.transcription.functions import ExpressionFunctions, function_of
from symphys.transcription.judge import Verdict, verdict
from symphys.transcription.probe import ExpressionProbe, Probe
from symphys.transcription.simulate import Record, recorder, simulate
from symphys.transcription.terms import Terms

Array = NDArray[np.float64]
Judge = Callable[..., Verdict]
"""(z, smoothing = 0) -> verdict."""
PRICING_CALLS = 5
"""How often a function is timed; the fastest call counts."""


@dataclass(frozen=True, eq=False)
class Transcription:
    """A problem, its shooting problem, and the exact rollout that judges and records; equal to itself only.

    Attributes:
        backend: what evaluates the shooting problem.
        build_seconds: until there were expressions; ``backend.seconds`` come on top.
    """

    problem: Problem
    rollout: Rollout
    terms: Terms
    functions: ExpressionFunctions
    shooting: ShootingProblem
    backend: Description
    build_seconds: float

    def judge(self, z: Array, smoothing: float = 0.0) -> Verdict:
        """How ``z`` does in the exact rollout, or in a smoothed one."""
        return self._judge(z, smoothing)

    def simulate(self, z: Array, smoothing: float = 0.0) -> Trajectory:
        """The motion; NotFinite if there is none."""
        return self.record(z, smoothing).motion

    def record(self, z: Array, smoothing: float = 0.0) -> Record:
        """The motion and the states and arguments that it is made from; NotFinite if there is none."""
        return simulate(self.rollout, self._recorder, z, smoothing)

    def prices(self, kinds: Iterable[str] = ("gradient", "jacobian")) -> dict[str, float]:
        """Measured cost of one "gradient", "jacobian" or "hessian" in rollouts, at the guess, one at a time.

        A Jacobian is that of the residuals, or of the constraints where there are none. Hessians are those of
        casadi's virtual machine, whatever the backend.
        """
        z, evaluator = self.shooting.start(0), self.shooting.evaluator
        one = fastest(lambda: evaluator.value(z[None], 0.0))
        calls: dict[str, Callable[[], object]] = {"gradient": lambda: evaluator.gradient(z[None], 0.0)}
        if self.shooting.squares:
            calls["jacobian"] = lambda: evaluator.jacobian(z[None], 0.0)
        elif self.terms.names:
            calls["jacobian"] = lambda: (self.shooting.nlp.jacobian or self.functions.constraint_jacobian)(z, 0.0)
        calls["hessian"] = lambda: self.functions.hessian(z, 0.0)
        return {kind: fastest(calls[kind]) / one for kind in kinds if kind in calls}

    @cached_property
    def probe(self) -> Probe:
        """What is differentiated to examine the gradient."""
        return ExpressionProbe(self.rollout, self.terms, self.shooting.evaluator)

    def back(self, record: Record, ends: Array) -> Iterator[Array]:
        """Derivatives of ends . x_N, with ``ends`` (nx, m), with respect to x_N-1, x_N-2 ... x_0: (nx, m) each."""
        course, step = record.course, self.rollout.closed
        backward, adjoint = step.reverse(ends.shape[1]), ends
        results = [np.zeros(step.numel_out(i)) for i in range(step.n_out())]
        inert = [np.zeros((len(result), ends.shape[1])) for result in results[1:]]
        for k in reversed(range(self.rollout.steps)):
            adjoint = np.array(backward(*course.closed_arguments(k, self.rollout), *results, adjoint, *inert)[0])
            yield adjoint

    @cached_property
    def _judge(self) -> Judge:
        return judge_of(self.rollout, self.terms)

    @cached_property
    def _recorder(self) -> ca.Function:
        return recorder(self.rollout)


def judge_of(rollout: Rollout, asked: Terms) -> Judge:
    """A judge of candidates by the exact rollout, without the functions that solvers need."""
    numbers = function_of(rollout, "judge", [asked.objective, asked.costs, asked.errors, asked.outputs])

    def judge(z: Array, smoothing: float = 0.0) -> Verdict:
        objective, *parts = (np.array(part).ravel() for part in numbers(z, smoothing))
        return verdict(rollout.problem, float(objective[0]), *parts)

    return judge


def fastest(call: Callable[[], object]) -> float:
    """Seconds of the fastest of a few calls."""
    times = []
    for _ in range(PRICING_CALLS):
        began = perf_counter()
        call()
        times.append(perf_counter() - began)
    return min(times)
