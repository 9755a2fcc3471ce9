"""A transcription: a problem with its shooting problem and the exact rollout that judges and records."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from time import perf_counter
from typing import TYPE_CHECKING, Any, ClassVar

import casadi as ca
import numpy as np

from symphys.codegen.backends import Description
from symphys.problem import DURATION, Problem
from symphys.records import dataclass
from symphys.shooting import ShootingProblem
from symphys.trajectory import Trajectory
from symphys.transcription.functions import ExpressionFunctions
from symphys.transcription.gradient_probe import ExpressionProbe, Probe
from symphys.transcription.judge import Assessment, assessment
from symphys.transcription.motion_values import motion_values
from symphys.transcription.objective import Terms
from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.step_evaluator import StepEvaluator
from symphys.types import Array

if TYPE_CHECKING:
    from symphys.transcription.simulation import Record

PRICING_CALLS = 5
"""Calls with which a function is timed; the fastest counts."""


@dataclass(frozen=True, eq=False)
class Transcription:
    """A problem, its shooting problem, and the exact rollout that judges and records; compared by identity.

    Attributes:
        described: describes the evaluator of the shooting problem, and makes it where nobody has asked for it yet.
        build_seconds: until there were expressions; ``backend.seconds`` come on top.
        records_contacts: whether ``record`` has the forces and gaps of contacts.
    """

    records_contacts: ClassVar[bool] = True

    problem: Problem
    rollout: Rollout
    functions: ExpressionFunctions
    shooting: ShootingProblem
    described: Callable[[], Description]
    build_seconds: float

    @property
    def backend(self) -> Description:
        """Return what evaluates the shooting problem."""
        return self.described()

    @cached_property
    def by_steps(self) -> Transcription:
        """Return the same evaluated by the steps of the staged problem; itself where that cannot be."""
        evaluator = self.shooting.by_steps
        if evaluator is None:
            return self
        assert isinstance(evaluator, StepEvaluator), "transcribe has made it"
        return replace(self, shooting=replace(self.shooting, evaluator=evaluator), described=lambda: evaluator.backend)

    @property
    def terms(self) -> Terms:
        """Return the terms of the exact rollout as expressions; built at the first access, which can take seconds."""
        return self.functions.terms

    def judge(self, z: Array, smoothing: float = 0.0) -> Assessment:
        """Assess ``z`` by the exact rollout, or by a smoothed one."""
        found = self._motion_values.call([z, self._simulated(z, smoothing)[0]])
        _, objective, *parts, _ = (np.array(part).ravel() for part in found)
        return assessment(self.rollout.problem, float(objective[0]), *parts)

    def simulate(self, z: Array, smoothing: float = 0.0) -> Trajectory:
        """Simulate z; NotFinite if a number is not finite."""
        return self.record(z, smoothing).motion

    def record(self, z: Array, smoothing: float = 0.0) -> Record:
        """Simulate z and return motion, states and arguments; NotFinite if a number is not finite."""
        from symphys.transcription.simulation import recorded

        return recorded(self.rollout, self._simulated(z, smoothing), z, smoothing)

    def _simulated(self, z: Array, smoothing: float) -> list[Array]:
        """Return the results of ``recorder`` for z; the last ones are cached for judging and recording."""
        key, last = (np.asarray(z, np.float64).tobytes(), smoothing), self._last.get("found")
        if last is None or last[0] != key:
            last = key, [np.array(part) for part in self._recorder(z, smoothing)]
            self._last["found"] = last
        return list(last[1])

    @cached_property
    def _last(self) -> dict[str, tuple[Any, list[Array]]]:
        return {}

    def motion(self, z: Array, x: Array, u: Array) -> Trajectory:
        """Return the motion of states (N + 1, nx) with inputs (N, m) of variables and the parameters of z (n,)."""
        from symphys.transcription.simulation import motion_of

        p = np.array(self._start(z)[2]).ravel()
        dt = self.rollout.parameters.step_length(self.problem.simulation, p)
        return motion_of(self.rollout, np.arange(len(x), dtype=np.float64) * float(dt), x, u, p)

    def timed(self, record: Record) -> Transcription:
        """Return a copy with the duration of a recorded motion; itself if no variable sets the duration."""
        if not self.problem.free_duration:
            return self
        simulation, duration = self.problem.simulation, float(record.arrays.time[-1])
        timed = replace(simulation, duration=duration, dt=duration / simulation.steps)
        problem = replace(self.problem, simulation=timed)
        rollout = replace(self.rollout, problem=problem)
        return replace(self, problem=problem, rollout=rollout)

    def prices(
        self, kinds: Iterable[str] = ("gradient", "jacobian"), clock: Callable[[], float] = perf_counter
    ) -> dict[str, float]:
        """Measure the cost of a "gradient", "jacobian" or "hessian" in rollouts, at the guess, one at a time.

        A Jacobian is that of the residuals, or of the constraints where there are none. Hessians are those of
        casadi's virtual machine, whatever the backend. ``clock``: ``time.process_time`` on a busy machine.
        """
        z, evaluator = self.shooting.start(0), self.shooting.evaluator
        one = fastest(lambda: evaluator.value(z[None], 0.0), clock)
        calls: dict[str, Callable[[], object]] = {"gradient": lambda: evaluator.gradient(z[None], 0.0)}
        if self.shooting.squares:
            calls["jacobian"] = lambda: evaluator.jacobian(z[None], 0.0)
        elif self.shooting.constraint_names:
            calls["jacobian"] = lambda: (self.shooting.nlp.jacobian or self.functions.constraint_jacobian)(z, 0.0)
        calls["hessian"] = lambda: self.functions.hessian(z, 0.0)
        return {kind: fastest(calls[kind], clock) / one for kind in kinds if kind in calls}

    @cached_property
    def probe(self) -> Probe:
        """Return the number that is differentiated to examine the gradient."""
        return ExpressionProbe(self.rollout, self.terms, self.shooting.evaluator)

    def back(self, record: Record, ends: Array) -> Iterator[Array]:
        """Derivatives of ends . x_N, with ``ends`` (nx, m), with respect to x_N-1, x_N-2 ... x_0: (nx, m) each."""
        arrays, step = record.arrays, self.rollout.closed
        backward, adjoint = self._backward(ends.shape[1]), ends
        results = [np.zeros(step.numel_out(i)) for i in range(step.n_out())]
        inert = [np.zeros((len(result), ends.shape[1])) for result in results[1:]]
        for k in reversed(range(self.rollout.steps)):
            adjoint = np.array(backward(*arrays.closed_arguments(k, self.rollout), *results, adjoint, *inert)[0])
            yield adjoint

    def pull(self, record: Record, states: Mapping[int, Array], parameters: Array) -> Array | None:
        """Return derivatives (n, m) by z of numbers that depend on single states and on the parameters.

        Args:
            record: an exact rollout.
            states: by the number of a state, the derivatives of all numbers by it, (nx, m).
            parameters: (np, m) their derivatives by p.

        Returns:
            None for problems with large nets, of which that is not known.
        """
        arrays, step, count = record.arrays, self.rollout.closed, parameters.shape[1]
        backward, adjoint = self._backward(count), np.zeros((step.size1_in(0), count))
        results = [np.zeros(step.numel_out(i)) for i in range(step.n_out())]
        inert = [np.zeros((len(result), count)) for result in results[1:]]
        inputs = np.zeros((*arrays.given.shape, count))
        for k in reversed(range(max(states) + 1)):
            adjoint = adjoint + states.get(k, 0)
            if k == 0:
                break
            arguments = arrays.closed_arguments(k - 1, self.rollout)
            adjoint, given, p = (np.array(part) for part in backward(*arguments, *results, adjoint, *inert)[:3])
            inputs[k - 1] = given[: inputs.shape[1]]
            parameters = parameters + p
            if self.problem.free_duration and self.rollout.feedback is not None:  # the time of this step
                duration = self.rollout.parameters.columns[DURATION]
                parameters[duration] += given[-1:] * ((k - 1) / self.rollout.steps)
        return self._pulled_start(record.z, adjoint, inputs, parameters)

    def _pulled_start(self, z: Array, x0: Array, inputs: Array, p: Array) -> Array:
        """Return (n, m) derivatives by z from those (nx, m), (N, nu, m), (np, m) by the start's parts."""
        start, count = self._start, p.shape[1]
        given = np.concatenate([inputs[:, :, i].T for i in range(count)], axis=1)
        known = [np.zeros(start.size_out(i)) for i in range(start.n_out())]
        return np.array(start.reverse(count)(z, *known, x0, given, p))

    def _backward(self, count: int) -> ca.Function:
        """Return the adjoint of the step for ``count`` directions, cached since it is slow to build."""
        if count not in self._adjoints:
            self._adjoints[count] = self.rollout.closed.reverse(count)
        return self._adjoints[count]

    @cached_property
    def _adjoints(self) -> dict[int, ca.Function]:
        return {}

    @cached_property
    def _start(self) -> ca.Function:
        """z -> (x0, given, p)."""
        rollout = self.rollout
        return ca.Function("start", [rollout.z], [ca.densify(part) for part in (rollout.x0, rollout.given, rollout.p)])

    @cached_property
    def _motion_values(self) -> ca.Function:
        return motion_values(self.rollout)

    @cached_property
    def _recorder(self) -> ca.Function:
        from symphys.transcription.simulation import recorder

        return recorder(self.rollout)


def gradient_prices(
    shooting: ShootingProblem, kinds: Iterable[str], clock: Callable[[], float] = perf_counter
) -> dict[str, float]:
    """Implement ``Transcription.prices`` where only gradients are available."""
    z, evaluator = shooting.start(0)[None], shooting.evaluator
    one = fastest(lambda: evaluator.value(z, 0.0), clock)
    return {kind: fastest(lambda: evaluator.gradient(z, 0.0), clock) / one for kind in kinds if kind == "gradient"}


def fastest(call: Callable[[], object], clock: Callable[[], float] = perf_counter) -> float:
    """Return the seconds of the fastest of a few calls, by a clock."""
    times = []
    for _ in range(PRICING_CALLS):
        began = clock()
        call()
        times.append(clock() - began)
    return min(times)
