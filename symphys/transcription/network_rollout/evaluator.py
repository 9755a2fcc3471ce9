"""Evaluates problems with large nets: one decision vector at a time, or many robots that share their weights."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.cuda import Device
from symphys.shooting import Values, WithoutResiduals
from symphys.transcription.network_rollout.context import Made, Stage
from symphys.transcription.network_rollout.forward_backward import Backward, Way, aim_arguments, forward
from symphys.transcription.network_rollout.layers import Layers

Array = NDArray[np.float64]
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
        self, made: Made, stage: Stage, threads: int, real: Any = np.float64, device: Device | None = None
    ) -> None:
        """``threads`` share the robots of a call; the nets have their precision, ``real``, and may be on a device."""
        self.made, self.stage, self.threads, self.real, self.device = made, stage, threads, real, device

    def shared(self, weights: Sequence[Array], Z: Array, smoothing: float = 0.0, gradient: bool = False) -> Shared:
        """Roll out robots.

        Args:
            weights: of each net, in the order of the file, shared by all robots.
            Z: (B, s) what robots do not share: the entries ``made.split.small`` of z.
            smoothing: [m/s].
            gradient: whether derivatives are wanted.
        """
        nets = self._nets(weights)
        count = max(1, min(self.threads, len(Z) // LEAST_ROBOTS))
        parts = np.array_split(Z, count)
        if count == 1:
            found = [self._part(nets, parts[0], smoothing, gradient)]
        else:
            with ThreadPoolExecutor(count) as pool:
                found = list(pool.map(lambda part: self._part(nets, part, smoothing, gradient), parts))
        common = Shared(*stacked(found))
        if not gradient:
            return common
        small = np.concatenate([part.small for part in found if part.small is not None])
        sums = zip(*(part.weights for part in found if part.weights is not None), strict=True)
        return replace(common, small=small, weights=tuple(np.sum(own, axis=0) for own in sums))

    def way(self, z: Array, smoothing: float) -> Way:
        """The motion of one decision vector."""
        parts = self.made.split
        return forward(self.made, self.stage, self.nets_at(z), z[None, parts.small], smoothing)

    def nets_at(self, z: Array) -> list[Layers]:
        """The nets of one decision vector."""
        return self._nets([own.at(z) for own in self.made.split.weights])

    def _nets(self, weights: Sequence[Array]) -> list[Layers]:
        return [
            Layers(law, own, self.real, self.device) for law, own in zip(self.made.split.laws, weights, strict=True)
        ]

    def _part(self, nets: Sequence[Layers], Z: Array, smoothing: float, gradient: bool) -> Shared:
        way = forward(self.made, self.stage, nets, Z, smoothing)
        values = Shared(*self._values(way))
        if not gradient:
            return values
        small, weights = Backward(self.made, self.stage, nets, way, smoothing, self.made.aims.slopes).run()
        return replace(values, small=small, weights=tuple(weights))

    def _values(self, way: Way) -> tuple[Array, Array, Array, Array]:
        found = [self.made.aims.value.call(aim_arguments(self.made, way, b)) for b in range(len(way.z))]
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
        split_, found = self.made.split, []
        for z in Z:
            weights = [own.at(z) for own in split_.weights]
            found.append(self.shared(weights, z[None, split_.small], smoothing, gradient))
        values = Values(*stacked(found))
        if not gradient:
            return values
        slopes = []
        for each in found:
            assert each.small is not None and each.weights is not None
            slopes.append(split_.joined(each.small[0], each.weights))
        return replace(values, gradient=np.array(slopes).reshape(len(Z), split_.n))


def stacked(parts: Sequence[Shared]) -> tuple[Array, Array, Array, Array]:
    """Merits, objectives, errors and outputs of all."""
    merit, objective, errors, outputs = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("merit", "objective", "errors", "outputs")
    )
    return merit, objective, errors, outputs
