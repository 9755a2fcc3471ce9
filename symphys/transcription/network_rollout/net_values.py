"""The values of a net's layers along a rollout: kept, or computed again a segment of time after the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from symphys.transcription.network_rollout.layers import Layers

SEGMENT_COLUMNS = 1024
"""Robots times steps of a segment: few enough that values are still in the cache for the gradient of the weights."""
KEPT_NUMBERS = 2**27
"""Of values, which all threads may keep: enough not to compute 1024 neurons of 128 robots in 1000 steps twice."""


class NetValues:
    """Values of a net's layers, in segments of steps.

    Of layers that are kept there are those of all steps, of others those of one segment.

    Attributes:
        net: whose.
        length: steps of a segment.
    """

    def __init__(self, net: Layers, robots: int, steps: int, kept: Sequence[bool], length: int) -> None:
        """``kept``: for what is sensed and each layer whether its values are kept; ``length``: steps of a segment."""
        self.net, self.length, self._robots, self._steps, self._kept = net, length, robots, steps, tuple(kept)
        segments = -(-steps // length) if any(kept) else 0
        columns = robots * min(length, steps)
        self._shared = [None if own else net.room(width, columns) for width, own in zip(net.widths, kept, strict=True)]
        layers = zip(net.widths, kept, strict=True)
        rooms = [net.rooms(segments, width, columns) if own else [None] * segments for width, own in layers]
        self._own = [list(segment) for segment in zip(*rooms, strict=True)]

    def at(self, step: int) -> list[Any]:
        """For each layer (width, robots) the values at a step: where they are, or are to be written."""
        segment, k = divmod(step, self.length)
        return [array[:, k * self._robots : (k + 1) * self._robots] for array in self._arrays(segment)]

    def again(self, segment: int) -> list[Any]:
        """For each layer (width, steps * robots) the values in a segment; what was not kept is computed again."""
        columns = self._robots * min(self.length, self._steps - segment * self.length)
        values = [array[:, :columns] for array in self._arrays(segment)]
        if not all(self._kept):
            self.net.forward(values, [not own for own in self._kept[1:]])
        return values

    def _arrays(self, segment: int) -> list[Any]:
        if not self._own:
            return self._shared
        return [a if b is None else b for a, b in zip(self._shared, self._own[segment], strict=True)]


def segment_length(robots: int, steps: int) -> int:
    """Steps of a segment."""
    return max(1, min(steps, SEGMENT_COLUMNS // robots))


def kept_layers(nets: Sequence[Layers], columns: int, room: int) -> list[list[bool]]:
    """For each net, for what is sensed and each layer, whether its values are kept.

    What is sensed is. Of the others those that cost most to compute for each number, until all take ``room`` numbers.
    """
    kept = [[True, *(False for _ in net.layers)] for net in nets]
    layers = [(layer.inputs, layer.outputs, n, i) for n, net in enumerate(nets) for i, layer in enumerate(net.layers)]
    for _, outputs, n, i in sorted(layers, reverse=True):
        if outputs * columns <= room:
            room -= outputs * columns
            kept[n][i + 1] = True
    return kept


def values_of(nets: Sequence[Layers], robots: int, steps: int, room: int) -> list[NetValues]:
    """For each net where a rollout keeps its values; ``room``: so many numbers at most; 0: for no gradient."""
    length = segment_length(robots, steps)
    if room == 0:
        return [NetValues(net, robots, 1, [False] * len(net.widths), 1) for net in nets]
    kept = kept_layers(nets, robots * steps, room)
    return [NetValues(net, robots, steps, own, length) for net, own in zip(nets, kept, strict=True)]
