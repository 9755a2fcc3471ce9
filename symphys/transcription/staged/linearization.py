"""The motion of a decision vector, and the derivatives of all its steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from symphys.codegen.backends import BEST
from symphys.codegen.backends.calls import row_by_row
from symphys.shooting import Linearized, StagedMotion
from symphys.transcription.formula_names import spans
from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.linearized_step import LinearizedStep, Pull, Slopes
from symphys.transcription.staged.tangent import Tangent
from symphys.types import Array, Ints

StepSlopes = tuple[Array, Array, Array]
"""Derivatives (nx, k), (m, k), (np, k) by the state before a step, its inputs and parameters."""
StepPull = Callable[[Array], StepSlopes]
MAX_LIFTED = 2**20
"""Numbers of bases of tangents that are computed at once."""
OFF_TANGENT_TOLERANCE = 1e-13
"""Relative size of slopes of the first state that counts as rounding: smaller ones lie on the tangent."""


class Linearization:
    """Motions of decision vectors, step by step, and derivatives about them.

    Attributes:
        rollout: of a problem.
        tangent: of its states.
        step: its step.
        statics: (s,) the entries of z that are no knots of a control.
    """

    def __init__(
        self,
        rollout: Rollout,
        backend: str = BEST,
        threads: int | None = None,
        exact: bool = False,
        wait: bool = False,
        step: LinearizedStep | None = None,
    ) -> None:
        """Compile the step; arguments are as in ``LinearizedStep``. ``step``: that of a rollout with an equal step."""
        self.rollout, self.statics = rollout, statics_of(rollout)
        self.step = step or LinearizedStep(rollout, Tangent(rollout), backend, threads, exact, wait=wait)
        self.tangent = self.step.tangent

    def sharing(self, step: LinearizedStep) -> Linearization:
        """Return the same with an equal step that may be compiled already."""
        return Linearization(self.rollout, step=step)

    def without_forces(self) -> Linearization:
        """Return the same motions with tangents without forces; see ``ReducedTangent``."""
        from symphys.transcription.staged.reduced_tangent import ReducedTangent

        own, tangent = self.step, ReducedTangent(self.rollout)
        step = LinearizedStep(self.rollout, tangent, own.backend, own.threads, own.exact, wait=own.wait, values=own)
        return Linearization(self.rollout, step=step)

    def motion(self, z: ArrayLike, smoothing: float, start: Array | None = None) -> StagedMotion:
        """Return the motion of z (len(z),), from its own first state or another one (nx,)."""
        given = np.asarray(z, float)
        x0, u, p = self.start(given)
        states = self.step.roll((x0 if start is None else start)[None], u[None], p[None], smoothing)[0]
        return StagedMotion(given, states, u, smoothing, gapless=True)

    def states(self, Z: Array, smoothing: float) -> Array:
        """Return the states (B, N + 1, nx) of Z (B, len(z))."""
        x0, u, p = (np.array(part) for part in zip(*map(self.start, Z), strict=True))
        return self.step.roll(x0, u, p, smoothing)

    def linearize(self, motion: StagedMotion) -> Linearized:
        """Return the derivatives of all steps about a motion.

        What the static entries do to the first state beside its tangent, such as the velocity of one body of a robot,
        is part of the first of ``c``: with it sums over the steps are exact.
        """
        p, after = self.parameters(motion.z), motion.x[1:] if motion.gapless else None
        slopes = self.step.slopes(motion.x[:-1], motion.u, p, motion.smoothing, after)
        return next(self._by_statics(motion, p, iter([slopes])))

    def linearize_from_end(self, motion: StagedMotion) -> Iterator[Linearized]:
        """Yield derivatives of runs of steps, the last run first; all runs start at once."""
        p, after = self.parameters(motion.z), motion.x[1:] if motion.gapless else None
        runs = self.step.slopes_from_end(motion.x[:-1], motion.u, p, motion.smoothing, after)
        return self._by_statics(motion, p, runs)

    def _by_statics(self, motion: StagedMotion, p: Array, runs: Iterator[Slopes]) -> Iterator[Linearized]:
        """Convert derivatives by parameters to those by static entries, run by run from the end."""
        start, left, parameters = self.start_slopes(motion)
        if not len(self.statics):
            for a, b, by_p in runs:
                yield Linearized(a, b, by_p[:, :, :0], start)
            return
        varied, end = self.step.arguments.varied, len(motion.u)
        for a, b, by_p in runs:
            c = by_p[:, :, varied] @ parameters[varied]
            end -= len(a)
            if not end and len(c) and left.any():
                c[0] += self.step.full_state_slopes(motion.x[0], motion.u[0], p, motion.smoothing) @ left
            yield Linearized(a, b, c, start)

    def pulls(self, x: Array, u: Array, p: Array, smoothing: float) -> Iterator[StepPull]:
        """Yield the adjoints of the steps along states (N + 1, nx) with inputs (N, m) and p (np,), the last one first.

        Inputs are without shares of phases. An adjoint takes derivatives (nx, k) by the state after its step, and
        returns those by the state before (nx, k), by its inputs (m, k) and by p (np, k).
        """
        (nx, n, m, np_), varied = self.step.arguments.sizes, self.step.arguments.varied
        adjoints = zip(self.step.pulls(x[:-1], x[1:], u, p, smoothing), self._lifts(x[:0:-1], p), strict=True)
        for k, (pull, lift) in zip(reversed(range(len(u))), adjoints, strict=True):
            shifts = [self._sparse(self.tangent.shift, x[i], p)[:, varied] for i in (k, k + 1) if self.tangent.shifts]

            def back(seeds: Array, pull: Pull = pull, lift: Array = lift, shifts: list[Array] = shifts) -> StepSlopes:
                found = pull(lift.T @ seeds)
                by_state, by_p = found[-nx:], np.zeros((np_, seeds.shape[1]))
                by_p[varied] = found[n + m : -nx]
                if shifts:  # there p moves both states with their joints, here the one before stays
                    by_p[varied] += shifts[1].T @ seeds - shifts[0].T @ by_state
                return by_state, found[n : n + m], by_p

            yield back

    def start_slopes(self, motion: StagedMotion) -> tuple[Array, Array, Array]:
        """Differentiate by the static entries: the first state in its tangent (n, s), its rest (nx, s), p (np, s)."""
        if not len(self.statics):
            nx, n, _, np_ = self.step.arguments.sizes
            return np.zeros((n, 0)), np.zeros((nx, 0)), np.zeros((np_, 0))
        key = np.append(motion.z[self.statics], motion.x[0])
        if self._known_start is not None and np.array_equal(self._known_start[0], key):
            return self._known_start[1]
        x0, p = motion.x[0], self.start(motion.z)[2]
        first, parameters = (np.array(ca.DM(part)) for part in self._start_slopes(motion.z))
        first = first - self._sparse(self.tangent.shift, x0, p) @ parameters
        start = self._sparse(self.tangent.projection, x0, p) @ first
        left = first - self._sparse(self.tangent.basis, x0, p) @ start
        off = np.where(np.abs(left) > OFF_TANGENT_TOLERANCE * np.abs(first).max(initial=0.0), left, 0.0)
        self._known_start = key, (start, off, parameters)
        return self._known_start[1]

    _known_start: tuple[Array, tuple[Array, Array, Array]] | None = None

    def _lifts(self, X: Array, p: Array) -> Iterator[Array]:
        """Yield the bases (nx, n) of the tangents at states X (N, nx)."""
        nx, n = self.step.arguments.sizes[:2]
        some = max(1, min(len(X), MAX_LIFTED // max(nx * n, 1)))
        for first in range(0, len(X), some):
            part = X[first : first + some]
            found = row_by_row(self.tangent.basis, part, p)[0]
            yield from found.reshape(len(part), n, nx).transpose(0, 2, 1)

    def full_parameters(self, p: Array) -> Array:
        """Return p (np,) of the steps from that of a rollout whose time step is no parameter."""
        return np.append(p, self._parameters[len(p) :])

    def parameters(self, z: Array) -> Array:
        """Return p (np,): without static entries the same for all z."""
        return self.start(z)[2] if len(self.statics) else self._parameters

    @cached_property
    def _parameters(self) -> Array:
        return self.start(np.zeros(int(self.rollout.z.shape[0])))[2]

    def start(self, z: Array) -> tuple[Array, Array, Array]:
        """Return first state (nx,), inputs (N, m) without shares of phases, and p (np,)."""
        x0, u, p = (np.array(part) for part in self._start.call([z]))
        return x0.ravel(), np.ascontiguousarray(u[: self.rollout.controls].T), p.ravel()

    @cached_property
    def _start(self) -> ca.Function:
        rollout = self.rollout
        return ca.Function("start", [rollout.z], [ca.densify(part) for part in (rollout.x0, rollout.given, rollout.p)])

    @cached_property
    def _start_slopes(self) -> ca.Function:
        """(z) -> derivatives of first state and p by the static entries."""
        rollout = self.rollout
        slopes = [ca.jacobian(part, rollout.z)[:, self.statics.tolist()] for part in (rollout.x0, rollout.p)]
        return ca.Function("slopes", [rollout.z], slopes)

    def _sparse(self, function: ca.Function, x: Array, p: Array) -> Array:
        return np.array(ca.DM(function(x, p)))


def statics_of(rollout: Rollout) -> Ints:
    """Return the entries of z that are not knots of a control."""
    variables = rollout.problem.variables
    found = [range(*span) for v, span in zip(variables, spans(variables), strict=True) if v.kind != "control"]
    return np.array([i for each in found for i in each], np.int64)
