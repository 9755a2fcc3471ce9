"""Evaluates problems with large nets: one decision vector at a time, or many robots that share their weights."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from symphys.codegen.cuda import Device
from symphys.shooting import Values, WithoutResiduals
from symphys.transcription.network_rollout.context import RolloutContext
from symphys.transcription.network_rollout.forward_backward import (
    BackwardPass,
    ForwardPass,
    forward,
    objective_arguments,
)
from symphys.transcription.network_rollout.layers import Layers
from symphys.transcription.network_rollout.net_values import KEPT_NUMBERS
from symphys.transcription.stage import BatchStep
from symphys.types import Array

LEAST_ROBOTS = 8
"""In a thread: what fills the lanes of a kernel."""


@dataclass(frozen=True)
class Shared:
    """Robots with shared weights.

    Attributes:
        merit, objective: (B,).
        errors: (B, e).
        outputs: (B, o).
        small: (B, s) gradient of each robot's merit with respect to what robots do not share; None if not asked for.
        weights: for each net (w,) the gradient of the sum of merits; None likewise.
    """

    merit: Array
    objective: Array
    errors: Array
    outputs: Array
    small: Array | None = None
    weights: tuple[Array, ...] | None = None


class LargeEvaluator(WithoutResiduals):
    """See ``Evaluator``; and ``shared`` for robots that share their weights."""

    def __init__(
        self,
        context: RolloutContext,
        batch_step: BatchStep,
        threads: int,
        real: Any = np.float64,
        device: Device | None = None,
    ) -> None:
        """``threads`` share the robots of a call; the nets have their precision, ``real``, and may be on a device."""
        self.context, self.batch_step, self.threads, self.real, self.device = context, batch_step, threads, real, device

    def shared(self, weights: Sequence[Array], Z: Array, smoothing: float = 0.0, gradient: bool = False) -> Shared:
        """Roll out robots.

        Args:
            weights: of each net, in the order of the file, shared by all robots.
            Z: (B, s) what robots do not share: the entries ``context.partition.small`` of z.
            smoothing: [m/s].
            gradient: whether derivatives are wanted.
        """
        count = max(1, min(self.threads, len(Z) // LEAST_ROBOTS))
        nets = self._nets(weights, len(Z) // count)
        parts, room = np.array_split(Z, count), KEPT_NUMBERS // count if gradient else 0
        if count == 1:
            found = [self._part(nets, parts[0], smoothing, room)]
        else:
            with ThreadPoolExecutor(count) as pool:
                found = list(pool.map(lambda part: self._part(nets, part, smoothing, room), parts))
        common = Shared(*stacked(found))
        if not gradient:
            return common
        small = np.concatenate([part.small for part in found if part.small is not None])
        sums = zip(*(part.weights for part in found if part.weights is not None), strict=True)
        return replace(common, small=small, weights=tuple(np.sum(own, axis=0) for own in sums))

    def forward_pass(self, z: Array, smoothing: float, room: int = 0) -> ForwardPass:
        """The motion of one decision vector; ``room``: see ``values_of``."""
        parts = self.context.partition
        return forward(self.context, self.batch_step, self.nets_at(z), z[None, parts.small], smoothing, room)

    def nets_at(self, z: Array) -> list[Layers]:
        """The nets of one decision vector."""
        return self._nets([own.at(z) for own in self.context.partition.weights], 1)

    def _nets(self, weights: Sequence[Array], robots: int) -> list[Layers]:
        return [
            Layers(law, own, robots, self.real, self.device)
            for law, own in zip(self.context.partition.laws, weights, strict=True)
        ]

    def _part(self, nets: Sequence[Layers], Z: Array, smoothing: float, room: int) -> Shared:
        kept = None if room else {k for k, _ in self.context.objectives.samples.moments}
        motion = forward(self.context, self.batch_step, nets, Z, smoothing, room, kept)
        values = Shared(*self._values(motion))
        if not room:
            return values
        small, weights = BackwardPass(
            self.context, self.batch_step, nets, motion, smoothing, self.context.objectives.slopes
        ).run()
        return replace(values, small=small, weights=tuple(weights))

    def _values(self, motion: ForwardPass) -> tuple[Array, Array, Array, Array]:
        found = [
            self.context.objectives.value.call(objective_arguments(self.context, motion, b))
            for b in range(len(motion.z))
        ]
        merit, objective, errors, outputs = (
            np.array([np.array(row[i]).ravel() for row in found]) for i in (0, 1, 2, 4)
        )
        return merit[:, 0], objective[:, 0], errors, outputs

    def value(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return self._each(Z, smoothing, gradient=False)

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """See ``Evaluator``."""
        return self._each(Z, smoothing, gradient=True)

    def _each(self, Z: Array, smoothing: float, gradient: bool) -> Values:
        partition, found = self.context.partition, []
        for z in Z:
            weights = [own.at(z) for own in partition.weights]
            found.append(self.shared(weights, z[None, partition.small], smoothing, gradient))
        values = Values(*stacked(found))
        if not gradient:
            return values
        slopes = []
        for each in found:
            assert each.small is not None and each.weights is not None
            slopes.append(partition.joined(each.small[0], each.weights))
        return replace(values, gradient=np.array(slopes).reshape(len(Z), partition.n))


def stacked(parts: Sequence[Shared]) -> tuple[Array, Array, Array, Array]:
    """Merits, objectives, errors and outputs of all."""
    merit, objective, errors, outputs = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("merit", "objective", "errors", "outputs")
    )
    return merit, objective, errors, outputs


class LargeProbe:
    """See ``Probe``; by the passes that solvers' gradients are made of."""

    def __init__(self, evaluator: LargeEvaluator) -> None:
        """By the nets and steps of an evaluator."""
        self._evaluator, self._context = evaluator, evaluator.context

    def values(self, Z: Array) -> Array:
        """See ``Probe``."""
        motions = (self._evaluator.forward_pass(z, 0.0) for z in Z)
        return np.array(
            [
                float(self._context.objectives.probe.call(objective_arguments(self._context, motion, 0))[0])
                for motion in motions
            ]
        )

    def gradient(self, z: Array) -> Array:
        """See ``Probe``."""
        evaluator = self._evaluator
        nets, motion = evaluator.nets_at(z), evaluator.forward_pass(z, 0.0, KEPT_NUMBERS)
        slopes = self._context.objectives.probe_slopes
        small, weights = BackwardPass(self._context, evaluator.batch_step, nets, motion, 0.0, slopes).run()
        return self._context.partition.joined(small[0], weights)
