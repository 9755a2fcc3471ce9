"""What is differentiated to examine the gradient of a problem with large nets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from symphys.transcription.network_rollout.evaluator import LargeEvaluator
from symphys.transcription.network_rollout.forward_backward import Backward, aim_arguments

Array = NDArray[np.float64]


class LargeProbe:
    """See ``Probe``; by the passes that solvers' gradients are made of."""

    def __init__(self, evaluator: LargeEvaluator) -> None:
        """By the nets and steps of an evaluator."""
        self._evaluator, self._made = evaluator, evaluator.made

    def values(self, Z: Array) -> Array:
        """See ``Probe``."""
        ways = (self._evaluator.way(z, 0.0) for z in Z)
        return np.array([float(self._made.aims.probe.call(aim_arguments(self._made, way, 0))[0]) for way in ways])

    def gradient(self, z: Array) -> Array:
        """See ``Probe``."""
        evaluator = self._evaluator
        nets, way = evaluator.nets_at(z), evaluator.way(z, 0.0)
        slopes = self._made.aims.probe_slopes
        small, weights = Backward(self._made, evaluator.stage, nets, way, 0.0, slopes).run()
        return self._made.split.joined(small[0], weights)
