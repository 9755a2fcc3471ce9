"""Forward and backward passes through time, for robots that share the weights of their nets.

Forwards, states and what is sensed are kept, and values of nets while there is room. Backwards, a segment of time after
the other, other values are computed again for a whole segment at once, steps are differentiated one by one, and the
gradient of the weights is one product a layer and segment.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from symphys.codegen.backends.calls import row_by_row
from symphys.records import dataclass
from symphys.transcription.network_rollout.context import RolloutContext
from symphys.transcription.network_rollout.layers import Layers, NetValues, values_of
from symphys.transcription.stage import BatchStep
from symphys.types import Array


@dataclass(frozen=True)
class ForwardPass:
    """The stored values of a forward pass of B robots.

    Attributes:
        rows: (N + 1, B, m) what each step is computed from: x, given, p, the times of the step, z.
        z: (B, s) what robots do not share.
        x: (N + 1, B, nx) states; of a pass of which only some are kept, these by their steps, and above and below one
            row for all steps.
        given: (N, B, nu) inputs before small controllers add to them.
        p: (B, np).
        interval: (B, 1) [s] the time step.
        last: how many steps are computed: after them a robot stays where it is.
        sensed: (N + 1, B, o) what large nets sense.
        asked: (N, B, a) values of formulas along the way.
        u: (N, B, nu) inputs.
        values: of each net.
    """

    rows: Array
    z: Array
    x: Any
    given: Array
    p: Array
    interval: Array
    last: int
    sensed: Array
    asked: Array
    u: Array
    values: Sequence[NetValues]


def forward(
    context: RolloutContext,
    batch_step: BatchStep,
    nets: Sequence[Layers],
    Z: Array,
    smoothing: float,
    room: int = 0,
    kept: Collection[int] | None = None,
    skipped: int = 0,
) -> ForwardPass:
    """Simulate robots (B, s) that share these nets.

    Args:
        context: of the problem.
        batch_step: takes a step.
        nets: with their weights.
        Z: (B, s) what robots do not share.
        smoothing: [m/s].
        room: see ``values_of``.
        kept: the numbers of the states that are wanted, after which there is no pass backwards; None: all.
        skipped: steps at the end that are not computed: the state stays, and what is summed over them is 0.
    """
    # Arrays of all steps, or of one step where only the states ``kept`` are stored.
    steps = context.rollout.steps
    x0, flat, p, sensed0, interval = row_by_row(context.start, Z)
    nx, nu, whole = x0.shape[1], context.rollout.given.shape[0], kept is None
    at = [k if whole else 0 for k in range(steps + 1)]
    rows = np.empty((at[-1] + 1, len(Z), nx + nu + p.shape[1] + 2 + Z.shape[1]))
    x, given, _, times, _ = parts = np.split(rows, np.cumsum([nx, nu, p.shape[1], 2]), axis=2)
    motion = ForwardPass(
        rows=rows,
        z=Z,
        x=x if kept is None else dict.fromkeys(kept, x0),
        given=given[:steps],
        p=p,
        interval=interval,
        last=steps - skipped,
        sensed=np.empty((at[-1] + 1, *sensed0.shape)),
        asked=np.zeros((steps, len(Z), batch_step.sizes.get("asked", 0))),
        u=np.zeros((steps, len(Z), nu)),
        values=values_of(nets, len(Z), steps, room),
    )
    x[0], motion.sensed[0], parts[2][:], parts[4][:] = x0, sensed0, p, Z
    # Each step: nets on the readings, then the compiled step.
    beside = list(zip(nets, motion.values, context.columns, context.partition.places, strict=True))
    for k, (now, then) in enumerate(pairwise(at[: motion.last + 1])):
        given[now], times[now] = flat[:, k * nu : (k + 1) * nu], interval * (k, k + 1)
        for net, own, columns, place in beside:
            values = own.at(k)
            net.set(values[0], motion.sensed[now][:, columns])
            net.forward(values)
            given[now] += net.outputs(values) @ place.T
        found = batch_step.forward(rows[now], [smoothing])
        x[then], motion.u[k], motion.sensed[then] = found["after"], found["inputs"], found["sensed"]
        if kept is not None and k + 1 in kept:
            motion.x[k + 1] = found["after"]
        if "asked" in found:
            motion.asked[k] = found["asked"]
    # Steps that are left out repeat the last state.
    for k in range(motion.last + 1, steps + 1):
        if kept is None or k in kept:
            motion.x[k] = x[at[motion.last]]
    return motion


def objective_arguments(context: RolloutContext, motion: ForwardPass, b: int) -> list[Array]:
    """Return the arguments of ``context.objectives`` for one robot."""
    samples = context.objectives.samples
    moments = [part for k, row in samples.moments for part in (motion.x[k][b], motion.u[row, b])]
    series, start = [], 0
    for symbol in samples.series.values():
        size = symbol.shape[0]
        series.append(motion.asked[:, b, start : start + size].T)
        start += size
    return [motion.z[b], motion.p[b], *moments, *series]


class BackwardPass:
    """The backward pass of a ``ForwardPass``: the gradient of the sum over robots."""

    def __init__(
        self,
        context: RolloutContext,
        batch_step: BatchStep,
        nets: Sequence[Layers],
        motion: ForwardPass,
        smoothing: float,
        slopes: ca.Function,
        discount: float = 0.0,
        each: bool = False,
    ) -> None:
        """Begin with ``slopes``, one of those of ``context.objectives``, at the robots' motions.

        Args:
            context: of the problem.
            batch_step: the step of the motion.
            nets: likewise.
            motion: forwards.
            smoothing: of it [m/s].
            slopes: of ``context.objectives``.
            discount: share of its adjoint that a state loses in each step back; above 0 it loses all where a motion
                was over, see ``AdjointDiscount``.
            each: whether each robot has a gradient of the weights for itself.
        """
        self.context, self.batch_step, self.nets, self.motion = context, batch_step, nets, motion
        self.smoothing, self.discount, self.each = [smoothing], discount, each
        self.z, self.p, self.interval = (np.zeros_like(part) for part in (motion.z, motion.p, motion.interval))
        self.at_x: dict[int, Array] = {}
        self.at_u: dict[int, Array] = {}
        self.asked = np.zeros_like(motion.asked)
        self.weights = [np.zeros((len(motion.z) if each else 1, net.net.sizes["weights"])) for net in nets]
        self.adjoints = [
            [net.room(width, len(motion.z) * own.length) for width in (*net.widths[1:], net.widths[-1])]
            for net, own in zip(nets, motion.values, strict=True)
        ]
        for b in range(len(motion.z)):
            self.start_robot(b, slopes)

    def start_robot(self, b: int, slopes: ca.Function) -> None:
        """Add the slopes at one robot's motion."""
        motion, samples = self.motion, self.context.objectives.samples
        found = [np.array(part) for part in slopes.call(objective_arguments(self.context, motion, b))]
        self.z[b], self.p[b], others = found[0].ravel(), found[1].ravel(), found[2:]
        for k, row in samples.moments:
            x, u, *others = others
            self.at_x.setdefault(min(k, motion.last), np.zeros_like(motion.x[0]))[b] += x.ravel()
            self.at_u.setdefault(row, np.zeros_like(motion.u[0]))[b] += u.ravel()
        start = 0
        for series in others:
            self.asked[:, b, start : start + len(series)] = series.T
            start += len(series)

    def run(self) -> tuple[Array, list[Array]]:
        """Return the gradients (B, s) of the robots' own numbers, and for each net those of the weights.

        They are (B, w), or (1, w) and summed over the robots.
        """
        steps = self.motion.last
        length = max((own.length for own in self.motion.values), default=steps)
        x, sensed = self.at_x.get(steps, np.zeros_like(self.motion.x[0])), np.zeros_like(self.motion.sensed[0])
        given = np.zeros_like(self.motion.given)
        for number in reversed(range(-(-steps // length))):
            x, sensed = self.segment(number, min(steps, number * length + length), x, sensed, given)
        motion = self.motion
        first = [motion.x[0], _flat(motion.given), motion.p, motion.sensed[0], motion.interval]
        (pulled,) = row_by_row(self.context.pull, motion.z, *first, x, _flat(given), self.p, sensed, self.interval)
        self.z += pulled
        return self.z, self.weights

    def segment(self, number: int, end: int, x: Array, sensed: Array, given: Array) -> tuple[Array, Array]:
        """Step back from ``end`` to the first step of a segment; return adjoints of state and readings."""
        first, robots = number * self.motion.values[0].length, len(x)
        values = [own.again(number) for own in self.motion.values]
        for k in range(end - 1, first - 1, -1):
            x, given[k], sensed = self.step(k, x, sensed)
            now = slice((k - first) * robots, (k - first + 1) * robots)
            for net, own, room, columns, place in zip(
                self.nets, values, self.adjoints, self.context.columns, self.context.partition.places, strict=True
            ):
                *deltas, output = (array[:, now] for array in room)
                net.set(output, given[k] @ place)
                sensed[:, columns] += net.pull([value[:, now] for value in own], output, deltas)
            if self.discount:
                share = (1 - self.discount) * self.context.alive(self.motion.x[k])
                x, sensed = x * share, sensed * share
        for b in range(robots) if self.each else (0,):
            used = slice(b, (end - first) * robots, robots if self.each else 1)
            for i, (net, own, room) in enumerate(zip(self.nets, values, self.adjoints, strict=True)):
                *deltas, output = (array[:, used] for array in room)
                self.weights[i][b] += net.gradient([value[:, used] for value in own], deltas, output)
        return x, sensed

    def step(self, k: int, x: Array, sensed: Array) -> tuple[Array, Array, Array]:
        """Step back once: adjoints of the state and inputs, and zeros for the previous readings."""
        parts = {"after": x, "sensed": sensed, "asked": self.asked[k]}
        parts["inputs"] = self.at_u.get(k, np.zeros_like(self.motion.u[0]))
        seeds = np.concatenate([parts[name] for name in self.batch_step.sizes], axis=1)
        _, slopes = self.batch_step.gradient(self.motion.rows[k], seeds, self.smoothing)
        sizes = [self.motion.x.shape[2], self.motion.given.shape[2], self.motion.p.shape[1], 2, self.motion.z.shape[1]]
        before, given, p, times, z = np.split(slopes, np.cumsum(sizes)[:-1], axis=1)
        self.interval += times @ [[k], [k + 1]]
        self.p += p
        self.z += z
        if k in self.at_x:
            before = before + self.at_x[k]
        return before, given, np.zeros_like(sensed)


def back(
    context: RolloutContext,
    batch_step: BatchStep,
    nets: Sequence[Layers],
    motion: ForwardPass,
    smoothing: float,
    ends: Array,
) -> Iterator[Array]:
    """Implement ``Transcription.back`` for the first robot of a pass."""
    count, interval = ends.shape[1], float(motion.interval[0, 0])
    nx, nu = motion.x.shape[2], motion.u.shape[2]
    sense, x = context.sense.reverse(count), ends.T
    blank = {name: np.zeros((count, size)) for name, size in batch_step.sizes.items()}
    for k in reversed(range(len(motion.u))):
        seeds = np.concatenate([(blank | {"after": x})[name] for name in batch_step.sizes], axis=1)
        _, slopes = batch_step.gradient(np.tile(motion.rows[k, :1], (count, 1)), seeds, [smoothing])
        given, sensed = slopes[:, nx : nx + nu], np.zeros((count, motion.sensed.shape[2]))
        for net, columns, place in zip(nets, context.columns, context.partition.places, strict=True):
            output, values = net.put((given @ place).T), net.sense(motion.sensed[k][:1, columns])
            deltas = [net.room(width, count) for width in net.widths[1:]]
            sensed[:, columns] += net.pull(values, output, deltas)
        through = sense(motion.x[k, 0], motion.p[0], k * interval, motion.sensed[k, 0], sensed.T)[0]
        x = slopes[:, :nx] + np.array(through).T
        yield x.T


def _flat(given: Array) -> Array:
    """Reshape (N, B, nu) to (B, N * nu)."""
    return given.swapaxes(0, 1).reshape(given.shape[1], -1)
