"""Changes of the last state taken back through steps and nets, for one robot."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from symphys.transcription.network_rollout.context import BatchStep, RolloutContext
from symphys.transcription.network_rollout.forward_backward import ForwardPass, rows
from symphys.transcription.network_rollout.layers import Layers

Array = NDArray[np.float64]


def back(
    context: RolloutContext,
    batch_step: BatchStep,
    nets: Sequence[Layers],
    motion: ForwardPass,
    smoothing: float,
    ends: Array,
) -> Iterator[Array]:
    """See ``Transcription.back``; of the first robot of a pass."""
    count, dt = ends.shape[1], context.rollout.dt
    nx, nu = motion.x.shape[2], motion.u.shape[2]
    sense, x = context.sense.reverse(count), ends.T
    blank = {name: np.zeros((count, size)) for name, size in batch_step.sizes.items()}
    for k in reversed(range(len(motion.u))):
        seeds = np.concatenate([(blank | {"after": x})[name] for name in batch_step.seeded], axis=1)
        _, slopes = batch_step.gradient(np.tile(rows(motion, k, dt)[:1], (count, 1)), seeds, [smoothing])
        given, sensed = slopes[:, nx : nx + nu], np.zeros((count, motion.sensed.shape[2]))
        for net, columns, place in zip(nets, context.columns, context.partition.places, strict=True):
            sensed[:, columns] += net.pull(net.forward(motion.sensed[k][:1, columns]), given @ place)[0]
        through = sense(motion.x[k, 0], motion.p[0], k * dt, motion.sensed[k, 0], sensed.T)[0]
        x = slopes[:, :nx] + np.array(through).T
        yield x.T
