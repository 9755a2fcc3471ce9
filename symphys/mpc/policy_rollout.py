"""Rollouts under a policy, compiled: all steps of several step lengths in one call, lanes hold step lengths.

The decisions of step k are v = clip(v_k + a ahead_k + s back_k d). There d is how far the state is from x_k in its
tangent, a the step length, and s the share of the feedback. This is the forward pass of differential dynamic
programming (Tassa, Mansard and Todorov, Control-Limited Differential Dynamic Programming, ICRA 2014, section III)
without Python between the steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.codegen import (
    FunctionCall,
    KernelUnavailable,
    MemoryLayout,
    Place,
    ProcessorKernel,
    Program,
    compile_program,
)
from symphys.mpc.horizon_costs import HorizonCosts
from symphys.transcription.feedback.controller_calls import control_calls
from symphys.transcription.program import step_calls
from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.linearized_step import LinearizedStep

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AffinePolicy:
    """Decisions as affine functions of the state, step by step.

    Attributes:
        x: (N, nx) states about which it is.
        v: (N, w) decisions there.
        ahead: (N, w) what a whole step adds.
        back: (N, w, n) by the tangent of the state.
    """

    x: Array
    v: Array
    ahead: Array
    back: Array


class PolicyRollout:
    """Motions under policies, and what they cost.

    Attributes:
        description: what evaluates, in words.
    """

    def __init__(
        self,
        step: LinearizedStep,
        costs: HorizonCosts,
        weights: Array,
        bounds: tuple[Array, Array],
        p: Array,
        threads: int | None = 1,
    ) -> None:
        """Compile it; without a compiler the steps are taken one after the other.

        Args:
            step: which is taken.
            costs: of the motion.
            weights: (m, w): the inputs of a step are weights @ v.
            bounds: (w,) each, of v.
            p: (np,) parameters of the rollout.
            threads: that share step lengths.
        """
        self._step, self._costs, self._weights, self._bounds, self._p = step, costs, weights, bounds, p
        self._kernel: ProcessorKernel | None = None
        try:
            self._kernel = compile_program(policy_program(step, costs, weights), threads=threads)
            self.description = f"lanes {self._kernel.report.lanes}, threads {self._kernel.threads}"
        except KernelUnavailable as error:
            self.description = f"step by step; {error}"

    def __call__(
        self,
        start: Array,
        policy: AffinePolicy,
        lengths: Array,
        clock: float,
        smoothing: float,
        shares: Array | float = 1.0,
    ) -> tuple[Array, Array, Array]:
        """From a state (nx,) with step lengths (B,): states (B, N + 1, nx), decisions (B, N, w) and costs (B,).

        ``clock``: [s] the time at the start. ``shares``: (B,) of the feedback. A motion that is not finite stays so.
        """
        if self._kernel is None:
            return self._step_by_step(start, policy, lengths, clock, smoothing, shares)
        parts = (policy.x, policy.v, policy.ahead, policy.back)
        shared = np.concatenate([*(each.ravel() for each in parts), *self._bounds, self._p, (clock, smoothing)])
        first = np.empty((len(lengths), 2 + len(start)))
        first[:, 0], first[:, 1], first[:, 2:] = lengths, shares, start
        found = self._kernel.forward(first, shared)
        count, steps = len(lengths), len(policy.v)
        return found["x"].reshape(count, steps + 1, -1), found["v"].reshape(count, steps, -1), found["cost"][:, 0]

    def _step_by_step(
        self,
        start: Array,
        policy: AffinePolicy,
        lengths: Array,
        clock: float,
        smoothing: float,
        shares: Array | float = 1.0,
    ) -> tuple[Array, Array, Array]:
        share = np.broadcast_to(shares, lengths.shape)[:, None]
        count, steps, dt = len(lengths), len(policy.v), self._step.rollout.dt
        x, v = np.empty((count, steps + 1, len(start))), np.empty((count, steps, policy.v.shape[1]))
        x[:, 0], cost = start, np.zeros(count)
        self._step.clock = clock
        for k in range(steps):
            off = self._step.tangent.difference(np.repeat(policy.x[None, k], count, axis=0), x[:, k], self._p)
            wanted = policy.v[k] + lengths[:, None] * policy.ahead[k] + share * (off @ policy.back[k].T)
            v[:, k] = np.clip(wanted, *self._bounds)
            x[:, k + 1] = self._step.step(k, x[:, k], v[:, k] @ self._weights.T, self._p, smoothing)
            for row in range(count):
                now, later = clock + k * dt, clock + (k + 1) * dt
                cost[row] += float(self._costs.before(x[row, k], v[row, k], self._p, now))
                cost[row] += float(self._costs.after(x[row, k + 1], v[row, k], self._p, later))
        last = (self._costs.end(x[row, -1], v[row, -1], self._p, clock + steps * dt) for row in range(count))
        return x, v, cost + np.array([float(each) for each in last])


class PolicyPlaces:
    """Where the program keeps a rollout; see ``controller_calls.Places``.

    What differs from lane to lane is (step length, share of the feedback, first state). What all share is the policy,
    step after step, the bounds, p, the clock and the smoothing; the body reads it where it lies.
    """

    def __init__(self, step: LinearizedStep, width: int) -> None:
        """Places for ``width`` decisions a step."""
        self.rollout: Rollout = step.rollout
        self.layout = layout = MemoryLayout()
        nx, n, m, np_ = step.arguments.sizes
        steps = self.rollout.steps
        self.row = layout.take(2 + nx)
        begun = layout.size
        self.about, self.decided = layout.series(nx, steps), layout.series(width, steps)
        self.ahead, self.back = layout.series(width, steps), layout.series(width * n, steps)
        self.lower, self.upper = layout.take(width), layout.take(width)
        self.p, self.clock, self.smoothing = layout.take(np_), layout.take(1), layout.take(1)
        self.shared = Place(begun, layout.size - begun)
        self.length, self.share = layout.take(1), layout.take(1)
        self.off, self.cost = layout.take(n), layout.take(1)
        self.x, self.v = layout.series(nx, steps + 1), layout.series(width, steps)
        self.given = layout.take(m)
        self.u = self.given if self.rollout.feedback is None else layout.take(m)
        self.time = layout.series(1, steps + 1)


def policy_program(step: LinearizedStep, costs: HorizonCosts, weights: Array) -> Program:
    """The program of a rollout under a policy, with the outputs ``x``, ``v`` and ``cost``."""
    rollout, tangent = step.rollout, step.tangent
    places = PolicyPlaces(step, weights.shape[1])
    steps, width = rollout.steps, int(weights.shape[1])
    row, clock = ca.SX.sym("row", places.row.size), ca.SX.sym("clock")
    first = ca.Function("first", [row], [row[0], row[1], row[2:]])
    times = ca.Function("times", [clock], [ca.densify(clock + ca.DM(np.arange(steps + 1)) * rollout.dt)])
    x, y, p = (ca.SX.sym(name, place.size) for name, place in (("x", places.x), ("y", places.x), ("p", places.p)))
    apart = ca.Function("apart", [x, y, p], [ca.densify(tangent.distance(x, y, p))])
    policy = (places.decided, places.ahead, places.back, places.off, places.lower, places.upper)
    decided = (places.length, places.share, *policy)
    here = (places.x, places.v, places.p, places.time)
    there = (places.x.later(), places.v, places.p, places.time.later())
    last = (places.x.later(steps), places.v.later(steps - 1), places.p, places.time.later(steps))
    body = [
        FunctionCall(apart, (places.about, places.x, places.p), (places.off,)),
        FunctionCall(decide(width, tangent.size, weights), decided, (places.v, places.given)),
        *control_calls(rollout, places),
        *step_calls(places, step.exact),
        FunctionCall(costs.before, here, (places.cost,), accumulate=True),
        FunctionCall(costs.after, there, (places.cost,), accumulate=True),
    ]
    return Program(
        size=places.layout.size,
        z=places.row,
        parameters=places.shared,
        steps=steps,
        outputs={
            "x": Place(places.x.offset, places.x.size * (steps + 1)),
            "v": Place(places.v.offset, places.v.size * steps),
            "cost": places.cost,
        },
        prologue=(
            FunctionCall(first, (places.row,), (places.length, places.share, places.x.still())),
            FunctionCall(times, (places.clock,), (Place(places.time.offset, steps + 1),)),
        ),
        body=tuple(body),
        epilogue=(FunctionCall(costs.end, tuple(each.still() for each in last), (places.cost,), accumulate=True),),
        zeroed=(places.cost,),
    )


def decide(width: int, n: int, weights: Array) -> ca.Function:
    """(length, share, v, ahead, back row by row, off, lower, upper) -> decisions and inputs of a step."""
    length, share, off = ca.SX.sym("length"), ca.SX.sym("share"), ca.SX.sym("off", n)
    v, ahead, lower, upper = (ca.SX.sym(name, width) for name in ("v", "ahead", "lower", "upper"))
    back = ca.SX.sym("back", width * n)
    answer = ca.mtimes(ca.reshape(back, n, width).T, off)
    chosen = ca.fmin(ca.fmax(v + length * ahead + share * answer, lower), upper)
    u = ca.mtimes(ca.DM(weights), chosen)
    return ca.Function("decide", [length, share, v, ahead, back, off, lower, upper], [chosen, ca.densify(u)])
