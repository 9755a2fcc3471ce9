"""Changes of the last state taken back through steps and nets, for one robot."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from symphys.transcription.network_rollout.context import Made, Stage
from symphys.transcription.network_rollout.forward_backward import Way, rows
from symphys.transcription.network_rollout.layers import Layers

Array = NDArray[np.float64]


def back(made: Made, stage: Stage, nets: Sequence[Layers], way: Way, smoothing: float, ends: Array) -> Iterator[Array]:
    """See ``Transcription.back``; of the first robot of a ``way``."""
    count, dt = ends.shape[1], made.rollout.dt
    nx, nu = way.x.shape[2], way.u.shape[2]
    sense, x = made.sense.reverse(count), ends.T
    blank = {name: np.zeros((count, size)) for name, size in stage.sizes.items()}
    for k in reversed(range(len(way.u))):
        seeds = np.concatenate([(blank | {"after": x})[name] for name in stage.seeded], axis=1)
        _, slopes = stage.gradient(np.tile(rows(way, k, dt)[:1], (count, 1)), seeds, [smoothing])
        given, sensed = slopes[:, nx : nx + nu], np.zeros((count, way.sensed.shape[2]))
        for net, columns, place in zip(nets, made.columns, made.split.places, strict=True):
            sensed[:, columns] += net.pull(net.forward(way.sensed[k][:1, columns]), given @ place)[0]
        through = sense(way.x[k, 0], way.p[0], k * dt, way.sensed[k, 0], sensed.T)[0]
        x = slopes[:, :nx] + np.array(through).T
        yield x.T
