"""Evaluation of problems with large nets: one decision vector at a time, or many robots that share weights."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np

from symphys.codegen.cuda import Device
from symphys.records import dataclass
from symphys.shooting import Values, WithoutResiduals
from symphys.transcription.network_rollout.context import RolloutContext
from symphys.transcription.network_rollout.forward_backward import (
    BackwardPass,
    ForwardPass,
    forward,
    objective_arguments,
)
from symphys.transcription.network_rollout.layers import MAX_KEPT_NUMBERS, Layers
from symphys.transcription.stage import BatchStep
from symphys.types import Array

MIN_ROBOTS_PER_THREAD = 8
"""Least number of robots in a thread, which fills the lanes of a kernel."""


@dataclass(frozen=True)
class Shared:
    """The results of robots with shared weights.

    Attributes:
        merit, objective: (B,).
        errors: (B, e).
        outputs: (B, o).
        alive: (B,) 1 where a motion lasted to its end, 0 where it was over before; None where none ever is.
        small: (B, s) gradient of each robot's merit with respect to what robots do not share; None if not asked for.
        weights: for each net the gradient (w,) of the sum of merits, or (B, w) that of each; None likewise.
    """

    merit: Array
    objective: Array
    errors: Array
    outputs: Array
    alive: Array | None = None
    small: Array | None = None
    weights: tuple[Array, ...] | None = None


@dataclass(frozen=True)
class Backward:
    """Options of a gradient.

    Attributes:
        discount: share of its adjoint that a state loses in each step back; 0: the exact gradient.
        each: whether each robot has a gradient of the weights for itself.
    """

    discount: float = 0.0
    each: bool = False


EXACT = Backward()


class LargeEvaluator(WithoutResiduals):
    """An ``Evaluator``; ``shared`` evaluates robots that share their weights."""

    def __init__(
        self,
        context: RolloutContext,
        batch_step: BatchStep,
        threads: int,
        real: Any = np.float64,
        device: Device | None = None,
    ) -> None:
        """Use ``threads`` threads for the robots; nets have the precision ``real``, and may be on a device."""
        self.context, self.batch_step, self.threads, self.real, self.device = context, batch_step, threads, real, device

    def shared(
        self,
        weights: Sequence[Array],
        Z: Array,
        smoothing: float = 0.0,
        gradient: bool = False,
        backward: Backward = EXACT,
        skipped: int = 0,
    ) -> Shared:
        """Simulate robots.

        Args:
            weights: of each net, in the order of the file, shared by all robots.
            Z: (B, s) what robots do not share: the entries ``context.partition.small`` of z.
            smoothing: [m/s].
            gradient: whether derivatives are wanted.
            backward: how they are taken.
            skipped: steps at the end that are not computed.
        """
        count = max(1, min(self.threads, len(Z) // MIN_ROBOTS_PER_THREAD))
        nets = self._nets(weights, len(Z) // count)
        room = MAX_KEPT_NUMBERS // count if gradient else 0

        def part(rows: Array) -> Shared:
            return self._part(nets, rows, smoothing, room, backward, skipped)

        if count == 1:
            return part(Z)
        with ThreadPoolExecutor(count) as pool:
            found = list(pool.map(part, np.array_split(Z, count)))
        common = stacked(found)
        if not gradient:
            return common
        small = np.concatenate([each.small for each in found if each.small is not None])
        own = zip(*(each.weights for each in found if each.weights is not None), strict=True)
        slopes = tuple(np.concatenate(each) if backward.each else np.sum(each, axis=0) for each in own)
        return replace(common, small=small, weights=slopes)

    def forward_pass(self, z: Array, smoothing: float, room: int = 0) -> ForwardPass:
        """Return the motion of one decision vector; ``room``: see ``values_of``."""
        parts = self.context.partition
        small = parts.whole(z[None])[:, parts.small]
        return forward(self.context, self.batch_step, self.nets_at(z), small, smoothing, room)

    def nets_at(self, z: Array) -> list[Layers]:
        """Return the nets of one decision vector."""
        return self._nets([own.at(z) for own in self.context.partition.weights], 1)

    def _nets(self, weights: Sequence[Array], robots: int) -> list[Layers]:
        return [
            Layers(law, own, robots, self.real, self.device)
            for law, own in zip(self.context.partition.laws, weights, strict=True)
        ]

    def _part(
        self, nets: Sequence[Layers], Z: Array, smoothing: float, room: int, backward: Backward, skipped: int
    ) -> Shared:
        objectives, steps = self.context.objectives, self.context.rollout.steps
        kept = None if room else {steps, *(k for k, _ in objectives.samples.moments)}
        motion = forward(self.context, self.batch_step, nets, Z, smoothing, room, kept, skipped)
        values = self._values(motion)
        if not room:
            return values
        discount, each = backward.discount, backward.each
        small, weights = BackwardPass(
            self.context, self.batch_step, nets, motion, smoothing, objectives.slopes, discount, each
        ).run()
        return replace(values, small=small, weights=tuple(own if each else own[0] for own in weights))

    def _values(self, motion: ForwardPass) -> Shared:
        found = [
            self.context.objectives.value.call(objective_arguments(self.context, motion, b))
            for b in range(len(motion.z))
        ]
        merit, objective, errors, outputs = (
            np.array([np.array(row[i]).ravel() for row in found]) for i in (0, 1, 2, 4)
        )
        alive = self.context.alive(motion.x[self.context.rollout.steps])
        lasted = alive[:, 0] if isinstance(alive, np.ndarray) else None
        return Shared(merit[:, 0], objective[:, 0], errors, outputs, lasted)

    def value(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.value``."""
        return self._value(list(self.context.partition.whole(Z)[:, None]), smoothing)

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.gradient``."""
        found = self._gradient(list(self.context.partition.whole(Z)[:, None]), smoothing)
        assert found.gradient is not None, "gradients were asked for"
        return replace(found, gradient=np.ascontiguousarray(found.gradient[:, : Z.shape[1]]))

    def sample_values(self, rows: Array, smoothing: float) -> Values:
        """Implement ``SampleEvaluator.sample_values``."""
        return self._value(self._alike(rows), smoothing)

    def sample_gradients(self, rows: Array, smoothing: float, discount: float, skipped: int) -> Values:
        """Implement ``SampleEvaluator.sample_gradients``."""
        return self._gradient(self._alike(rows), smoothing, discount, skipped)

    def _value(self, groups: Sequence[Array], smoothing: float) -> Values:
        small = self.context.partition.small
        return _values(stacked([self.shared(self._weights(Z), Z[:, small], smoothing) for Z in groups]))

    def _gradient(self, groups: Sequence[Array], smoothing: float, discount: float = 0.0, skipped: int = 0) -> Values:
        """Evaluate gradients of rows in groups that share their weights."""
        partition, backward, slopes = self.context.partition, Backward(discount, each=True), list[Array]()
        found = list[Shared]()
        for rows in groups:
            weights, small = self._weights(rows), rows[:, partition.small]
            found.append(self.shared(weights, small, smoothing, True, backward, skipped))
            assert found[-1].small is not None and found[-1].weights is not None
            each = zip(found[-1].small, zip(*found[-1].weights, strict=True), strict=True)
            slopes += [partition.joined(own, of_weights) for own, of_weights in each]
        return replace(_values(stacked(found)), gradient=np.array(slopes).reshape(len(slopes), partition.n))

    def _alike(self, Z: Array) -> list[Array]:
        """Group rows that share their weights; single rows where they do not."""
        entries = np.concatenate([own.of_z for own in self.context.partition.weights])
        return [Z] if np.array_equal(Z[:, entries], np.tile(Z[:1, entries], (len(Z), 1))) else list(Z[:, None])

    def _weights(self, rows: Array) -> list[Array]:
        return [own.at(rows[0]) for own in self.context.partition.weights]


def stacked(parts: Sequence[Shared]) -> Shared:
    """Concatenate the values of all robots, without gradients."""
    names = ("merit", "objective", "errors", "outputs", *(("alive",) if parts[0].alive is not None else ()))
    whole: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return Shared(**whole)


def _values(found: Shared) -> Values:
    return Values(found.merit, found.objective, found.errors, found.outputs, alive=found.alive)


class LargeProbe:
    """A ``Probe`` by the same passes as the solvers' gradients."""

    def __init__(self, evaluator: LargeEvaluator) -> None:
        """Use the nets and steps of an evaluator."""
        self._evaluator, self._context = evaluator, evaluator.context

    def values(self, Z: Array) -> Array:
        """Implement ``Probe.values``."""
        motions = (self._evaluator.forward_pass(z, 0.0) for z in Z)
        return np.array(
            [
                float(self._context.objectives.probe.call(objective_arguments(self._context, motion, 0))[0])
                for motion in motions
            ]
        )

    def gradient(self, z: Array) -> Array:
        """Implement ``Probe.gradient``."""
        evaluator = self._evaluator
        nets, motion = evaluator.nets_at(z), evaluator.forward_pass(z, 0.0, MAX_KEPT_NUMBERS)
        slopes = self._context.objectives.probe_slopes
        small, weights = BackwardPass(self._context, evaluator.batch_step, nets, motion, 0.0, slopes).run()
        return self._context.partition.joined(small[0], [own[0] for own in weights])[: z.size]
