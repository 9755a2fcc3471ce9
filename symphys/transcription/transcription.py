"""A transcription: a problem with its shooting problem and the exact rollout that judges and records."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from time import perf_counter
from typing import TYPE_CHECKING, ClassVar

import casadi as ca
import numpy as np

from symphys.codegen.backends import PRECISIONS, Description
from symphys.codegen.backends.calls import row_by_row
from symphys.model.state_layout import Layout
from symphys.problem import Problem
from symphys.records import dataclass
from symphys.shooting import ShootingProblem
from symphys.trajectory import Trajectory
from symphys.transcription.functions import ExpressionFunctions
from symphys.transcription.gradient_probe import CachedProbe, Probe
from symphys.transcription.judge import Assessment, assessment
from symphys.transcription.motion_values import motion_values, probe_slopes
from symphys.transcription.objective import Terms
from symphys.transcription.recorded_parts import RolloutArrays
from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.step_evaluator import StepEvaluator
from symphys.types import Array, Ints

if TYPE_CHECKING:
    from symphys.transcription.simulation import Record
    from symphys.transcription.staged.linearization import Linearization, StepPull

PRICING_CALLS = 5
"""Calls with which a function is timed at most; the fastest counts."""
PRICED = 0.01
"""[s] after which a function is called no more to be timed."""


@dataclass(frozen=True, eq=False)
class Transcription:
    """A problem, its shooting problem, and the exact rollout that judges and records; compared by identity.

    Attributes:
        described: describes the evaluator of the shooting problem, and makes it where nobody has asked for it yet.
        build_seconds: until there were expressions; ``backend.seconds`` come on top.
        steps: makes what takes the steps of its motions one by one, and differentiates them.
        records_contacts: whether ``record`` has the forces and gaps of contacts.
    """

    records_contacts: ClassVar[bool] = True

    problem: Problem
    rollout: Rollout
    functions: ExpressionFunctions
    shooting: ShootingProblem
    described: Callable[[], Description]
    build_seconds: float
    steps: Callable[[], Linearization]

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
        arrays = self.arrays(z, smoothing)
        found = self._motion_values.call([z, arrays.x.T, arrays.p])
        _, objective, *parts, _ = (np.array(part).ravel() for part in found)
        return assessment(self.rollout.problem, float(objective[0]), *parts)

    def errors(self, Z: Array) -> Array:
        """Return (B, k) error / tolerance of what is asked for in the exact rollouts of Z (B, n), side by side."""
        return self._values_of(Z)[3]

    @property
    def quick_motions(self) -> bool:
        """Whether ``motions`` are computed side by side, by machine code."""
        return self.steps().step.backend in PRECISIONS and not self._cache.by_reports

    def motions(self, Z: Array, ticks: Ints) -> tuple[Array, Array, Array]:
        """Return times (B, F), positions (B, F, bodies, 3) and orientations (.., 4) at some ``ticks`` (F,) of Z (B, n).

        They are those of exact rollouts, which may be not finite.
        """
        rollout, layout = self.rollout, Layout(self.rollout.world)
        dt = [rollout.parameters.step_length(self.problem.simulation, p) for p in row_by_row(self._start, Z)[2]]
        x = self.steps().states(np.asarray(Z, float), 0.0)[:, ticks]
        names = [body.name for body in rollout.world.bodies]
        fields = ([x[:, :, layout[f"{name}.{of}"]] for name in names] for of in ("position", "orientation"))
        position, orientation = (np.stack(parts, axis=2) for parts in fields)
        return np.outer(np.array([float(np.ravel(each)[0]) for each in dt]), ticks), position, orientation

    def simulate(self, z: Array, smoothing: float = 0.0) -> Trajectory:
        """Simulate z; NotFinite if a number is not finite."""
        return self.record(z, smoothing).motion

    def record(self, z: Array, smoothing: float = 0.0) -> Record:
        """Simulate z and return motion, states and arguments; NotFinite if a number is not finite.

        The last record is cached. Each step is taken by casadi's virtual machine too; where one leads elsewhere, all of
        the motion is that of the virtual machine.
        """
        from symphys.transcription.simulation import recorded, simulate

        key, last = _key(z, smoothing), self._cache.record
        if last is not None and last[0] == key:
            return last[1]
        found = None if self._cache.by_reports else recorded(self.rollout, self.arrays(z, smoothing))
        if found is None:
            self._cache.by_reports, self._cache.last = True, None
            found = simulate(self.rollout, self._reported, np.array(z, float), smoothing)
        self._cache.record = key, found
        return found

    def arrays(self, z: Array, smoothing: float = 0.0) -> RolloutArrays:
        """Return states and arguments of the motion of z, which may be not finite; the last ones are cached."""
        key, last = _key(z, smoothing), self._cache.last
        if last is None or last[0] != key:
            last = self._cache.last = key, self._simulated(np.array(z, float), smoothing)
        return last[1]

    def _reported(self, z: Array, smoothing: float) -> list[Array]:
        """Return the results of ``recorder``; the last ones are cached."""
        key, last = _key(z, smoothing), self._cache.reported
        if last is None or last[0] != key:
            last = self._cache.reported = key, self._recorder(z, smoothing)
        return last[1]

    def _simulated(self, z: Array, smoothing: float) -> RolloutArrays:
        rollout, steps = self.rollout, self.steps()
        _, given, p = (np.array(part) for part in self._start(z))
        dt = float(np.ravel(rollout.parameters.step_length(self.problem.simulation, p.ravel()))[0])
        time = np.arange(rollout.steps + 1, dtype=np.float64) * dt
        if self._cache.by_reports or (smoothing and steps.step.exact):
            x, u = (part.T for part in self._reported(z, smoothing)[:2])
        else:
            x = steps.states(z[None], smoothing)[0]
            u = given.T
            if rollout.feedback is not None:
                u = row_by_row(rollout.feedback, x[:-1], u, p.ravel(), time[:-1, None])[0]
        return RolloutArrays(z, smoothing, x, u, given.T, p.ravel(), time)

    def simulate_by_reports(self) -> None:
        """Let casadi's virtual machine give all motions, by functions that report what happened; build no others."""
        self._cache.by_reports = True

    @cached_property
    def _cache(self) -> _Cache:
        return _Cache()

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
        return CachedProbe(self._probe_values, self._probe_gradient)

    def _probe_values(self, Z: Array) -> Array:
        known = self.shooting.evaluator.value(Z, 0.0).probe if self._cache.gives_probes else None
        if known is not None:
            return known
        self._cache.gives_probes = False
        return self._values_of(Z)[-1][:, 0]

    def _values_of(self, Z: Array) -> list[Array]:
        """Return the results of ``motion_values`` for exact rollouts."""
        X, P = self.steps().states(np.asarray(Z, float), 0.0), row_by_row(self._start, Z)[2]
        return row_by_row(self._motion_values, Z, X, P)

    def _probe_gradient(self, z: Array) -> Array:
        arrays = self.arrays(z)
        direct, by_states, by_p = (np.array(part) for part in self._probe_slopes(z, arrays.x.T, arrays.p))
        states = {k: by_states[:, k, None] for k in range(len(arrays.x))}
        pulled = self._pull(arrays, states, by_p.reshape(-1, 1))
        return np.asarray(direct.ravel() + pulled[:, 0])

    def back(self, record: Record, ends: Array) -> Iterator[Array]:
        """Derivatives of ends . x_N, with ``ends`` (nx, m), with respect to x_N-1, x_N-2 ... x_0: (nx, m) each."""
        adjoint = ends
        for pull in self._pulls(record.arrays):
            adjoint, _, _ = pull(adjoint)
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
        return self._pull(record.arrays, states, parameters)

    def _pull(self, arrays: RolloutArrays, states: Mapping[int, Array], parameters: Array) -> Array:
        end, count = max(states), parameters.shape[1]
        adjoint, inputs = np.zeros((arrays.x.shape[1], count)), np.zeros((*arrays.given.shape, count))
        for k, pull in zip(range(end, 0, -1), self._pulls(arrays, end), strict=True):
            adjoint, given, p = pull(adjoint + states.get(k, 0))
            inputs[k - 1, : len(given)] = given
            parameters = parameters + p[: len(parameters)]
        return self._pulled_start(arrays.z, adjoint + states.get(0, 0), inputs, parameters)

    def _pulls(self, arrays: RolloutArrays, end: int | None = None) -> Iterator[StepPull]:
        """Yield the adjoints of the steps before state ``end``, the last one first."""
        steps, stop = self.steps(), self.rollout.steps if end is None else end
        u = arrays.given[:stop, : self.rollout.controls]
        return steps.pulls(arrays.x[: stop + 1], u, steps.full_parameters(arrays.p), arrays.smoothing)

    def _pulled_start(self, z: Array, x0: Array, inputs: Array, p: Array) -> Array:
        """Return (n, m) derivatives by z from those (nx, m), (N, nu, m), (np, m) by the start's parts."""
        start, count = self._start, p.shape[1]
        given = np.concatenate([inputs[:, :, i].T for i in range(count)], axis=1)
        known = [np.zeros(start.size_out(i)) for i in range(start.n_out())]
        return np.array(start.reverse(count)(z, *known, x0, given, p))

    @cached_property
    def _start(self) -> ca.Function:
        """z -> (x0, given, p)."""
        rollout = self.rollout
        return ca.Function("start", [rollout.z], [ca.densify(part) for part in (rollout.x0, rollout.given, rollout.p)])

    @cached_property
    def _motion_values(self) -> ca.Function:
        return motion_values(self.rollout)

    @cached_property
    def _probe_slopes(self) -> ca.Function:
        return probe_slopes(self.rollout)

    @cached_property
    def _recorder(self) -> Callable[[Array, float], list[Array]]:
        from symphys.transcription.simulation import recorder

        return recorder(self.rollout)


Key = tuple[bytes, float]
"""z and smoothing."""


def _key(z: Array, smoothing: float) -> Key:
    return np.asarray(z, np.float64).tobytes(), smoothing


class _Cache:
    """The last motion, and what evaluations have shown of the kernels.

    Attributes:
        last: the last motion, with its z and smoothing.
        record: likewise the last record.
        reported: likewise the last results of the virtual machine's rollout.
        by_reports: whether the virtual machine's reports give all motions: it has taken a step elsewhere than the
            kernel, or no kernel is to be built.
        gives_probes: whether values of the evaluator come with the probe, as those of kernels do.
    """

    def __init__(self) -> None:
        """Begin with nothing."""
        self.last: tuple[Key, RolloutArrays] | None = None
        self.record: tuple[Key, Record] | None = None
        self.reported: tuple[Key, list[Array]] | None = None
        self.by_reports, self.gives_probes = False, True


def gradient_prices(
    shooting: ShootingProblem, kinds: Iterable[str], clock: Callable[[], float] = perf_counter
) -> dict[str, float]:
    """Implement ``Transcription.prices`` where only gradients are available."""
    z, evaluator = shooting.start(0)[None], shooting.evaluator
    one = fastest(lambda: evaluator.value(z, 0.0), clock)
    return {kind: fastest(lambda: evaluator.gradient(z, 0.0), clock) / one for kind in kinds if kind == "gradient"}


def fastest(call: Callable[[], object], clock: Callable[[], float] = perf_counter) -> float:
    """Return the seconds of the fastest of a few calls, by a clock."""
    times = list[float]()
    while len(times) < PRICING_CALLS and sum(times) < PRICED:
        began = clock()
        call()
        times.append(clock() - began)
    return min(times)
