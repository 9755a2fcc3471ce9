"""What is differentiated to examine the gradient of a problem with large nets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from symphys.transcription.network_rollout.evaluator import LargeEvaluator
from symphys.transcription.network_rollout.forward_backward import BackwardPass, objective_arguments

Array = NDArray[np.float64]


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
        nets, motion = evaluator.nets_at(z), evaluator.forward_pass(z, 0.0)
        slopes = self._context.objectives.probe_slopes
        small, weights = BackwardPass(self._context, evaluator.batch_step, nets, motion, 0.0, slopes).run()
        return self._context.partition.joined(small[0], weights)
