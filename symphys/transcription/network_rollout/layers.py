"""A net over a batch: forward and backward, and the gradient of its weights as one product for many steps.

Values of a layer are a matrix with a column for each robot, or for each robot and step. Arrays of a device know numpy's
functions.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.cuda import Device
from symphys.model.controllers import Net
from symphys.model.controllers.net import Activation

Array = NDArray[Any]
MAX_UNCOPIED_ROBOTS = 8
"""Robots in a batch for which transposed copies of the matrices do not pay."""
MIN_PADDED_ROW = 2**12
"""[bytes] Shortest row that gets ``PADDING_COLUMNS``; shorter rows are contiguous."""
PADDING_COLUMNS = 16
"""Unused columns: rows a power of two apart would share few cache lines."""


class Layers:
    """A net with its weights in one precision.

    The BLAS multiplies fastest where a matrix of float32 comes before rows that are contiguous, and where columns of
    float64 are contiguous: 99 instead of 75 GFlop/s, and 48 instead of 43, at 64 robots and 1024 neurons.
    """

    def __init__(self, net: Net, weights: Array, robots: int, real: Any, device: Device | None = None) -> None:
        """Store weights for a number of robots as ``real`` (numpy.float64 or float32), on a device if given."""
        self.net, self.real, self.device, self.layers = net, np.dtype(real), device, tuple(net.layers())
        weights = self.put(weights)
        self.matrices = [weights[layer.matrix].reshape(layer.outputs, layer.inputs) for layer in self.layers]
        self.biases = [weights[layer.biases][:, None] for layer in self.layers]
        self.straight = weights[net.straight].reshape(net.outputs, net.senses) if net.skip else None
        self.rows = self.real == np.float32 and robots > 1
        self.copied = robots >= MAX_UNCOPIED_ROBOTS
        self.widths = (net.senses, *(layer.outputs for layer in self.layers))

    def put(self, values: Array) -> Any:
        """Convert numbers to this precision and device."""
        own = np.asarray(values, self.real)
        return own if self.device is None else self.device.put(own)

    def set(self, into: Any, values: Array) -> None:
        """Write host numbers (columns, width) into an array (width, columns) of the device."""
        into[...] = values.T if self.device is None else self.put(values.T)

    def get(self, values: Any) -> Array:
        """Return numbers on the host."""
        return np.asarray(values if self.device is None else self.device.get(values))

    def room(self, width: int, columns: int) -> Any:
        """Return an uninitialised array (width, columns)."""
        return self.rooms(1, width, columns)[0]

    def rooms(self, count: int, width: int, columns: int) -> list[Any]:
        """Allocate several arrays as one block, for which the system uses large pages and fewer page faults."""
        padding = PADDING_COLUMNS if columns * self.real.itemsize >= MIN_PADDED_ROW else 0
        shape = (count, width, columns + padding) if self.rows else (count, columns, width)
        made = np.empty(shape, self.real) if self.device is None else self.device.empty(shape, self.real)
        return [(made[i] if self.rows else made[i].T)[:, :columns] for i in range(count)]

    @cached_property
    def _turned(self) -> list[Any]:
        return [matrix.T.copy() for matrix in self.matrices]

    def _product(self, number: int, values: Any, turned: bool, out: Any) -> Any:
        """Multiply a matrix, or its transpose, with (width, columns)."""
        stored = turned == self.rows and self.copied
        matrix = (self._turned if stored else self.matrices)[number]
        return np.matmul(matrix.T if turned != stored else matrix, values, out=out)

    def sense(self, sensed: Array) -> list[Any]:
        """Convert readings (columns, n) to the first values of ``forward``."""
        given = self.put(sensed.T)
        values = [given, *(self.room(width, given.shape[1]) for width in self.widths[1:])]
        self.forward(values)
        return values

    def forward(self, values: Sequence[Any], chosen: Sequence[bool] | None = None) -> None:
        """Compute the values of every layer from the readings; those of the last one before ``skip``.

        They stay where they are computed, as all that is handed on between the methods does. ``chosen``: the layers
        that are computed; the others have been; None: all.
        """
        for i, (layer, bias) in enumerate(zip(self.layers, self.biases, strict=True)):
            if chosen is None or chosen[i]:
                raw = self._product(i, values[i], False, values[i + 1])
                if bias.size:
                    np.add(raw, bias, out=raw)
                activate(layer.activation, raw)

    def outputs(self, values: Sequence[Any]) -> Array:
        """Return outputs (columns, m) from the values of ``forward``."""
        return self.get(values[-1] if self.straight is None else values[-1] + self.straight @ values[0]).T

    def pull(self, values: Sequence[Any], adjoint: Any, deltas: Sequence[Any]) -> Array:
        """Propagate adjoints backward through the net.

        Args:
            values: of ``forward``.
            adjoint: (m, columns) of the outputs, where products are computed.
            deltas: for each layer the adjoints before its activation are written there, (width, columns).

        Returns:
            The adjoint (columns, n) of what is sensed.
        """
        back = adjoint
        for i, layer in reversed(list(enumerate(self.layers))):
            through(layer.activation, values[i + 1], back, deltas[i])
            back = self._product(i, deltas[i], True, self.room(layer.inputs, deltas[i].shape[1]))
        return self.get(back if self.straight is None else back + self.straight.T @ adjoint).T

    def gradient(self, values: Sequence[Any], deltas: Sequence[Any], adjoint: Any) -> Array:
        """Return (w,) of all weights: one product a layer over all columns of the arguments of ``pull``."""
        parts = []
        for value, delta in zip(values, deltas, strict=False):
            parts.append((delta @ value.T).ravel())
            if self.net.biases:
                parts.append(delta.sum(axis=1))
        if self.straight is not None:
            parts.append((adjoint @ values[0].T).ravel())
        return self.get(np.concatenate(parts))


def activate(activation: Activation, raw: Any) -> None:
    """Apply the activation in place."""
    if activation == "tanh":
        np.tanh(raw, out=raw)
    elif activation == "relu":
        np.maximum(raw, 0, out=raw)


def through(activation: Activation, value: Any, back: Any, out: Any) -> None:
    """Return adjoints (width, columns) before an activation with this value, from those after it."""
    if activation == "tanh":
        slope = value * value  # one run of numbers, unlike ``out``
        np.subtract(1, slope, out=slope)
        np.multiply(slope, back, out=out)
    elif activation == "relu":
        np.multiply(value > 0, back, out=out)
    else:
        np.positive(back, out=out)


SEGMENT_COLUMNS = 1024
"""Robots times steps of a segment, whose values then stay in the cache for the gradient of the weights."""
MAX_KEPT_NUMBERS = 2**27
"""Of values, which all threads may keep: enough not to compute 1024 neurons of 128 robots in 1000 steps twice."""


class NetValues:
    """Values of a net's layers, in segments of steps.

    Of layers that are kept there are those of all steps, of others those of one segment.

    Attributes:
        net: the net.
        length: steps of a segment.
    """

    def __init__(self, net: Layers, robots: int, steps: int, kept: Sequence[bool], length: int) -> None:
        """Set which values are kept, for readings and each layer; ``length``: steps of a segment."""
        self.net, self.length, self._robots, self._steps, self._kept = net, length, robots, steps, tuple(kept)
        segments = -(-steps // length) if any(kept) else 0
        columns = robots * min(length, steps)
        self._shared = [None if own else net.room(width, columns) for width, own in zip(net.widths, kept, strict=True)]
        layers = zip(net.widths, kept, strict=True)
        rooms = [net.rooms(segments, width, columns) if own else [None] * segments for width, own in layers]
        self._own = [list(segment) for segment in zip(*rooms, strict=True)]

    def at(self, step: int) -> list[Any]:
        """Return for each layer the array (width, robots) of its values at a step, to be read or written."""
        segment, k = divmod(step, self.length)
        return [array[:, k * self._robots : (k + 1) * self._robots] for array in self._arrays(segment)]

    def again(self, segment: int) -> list[Any]:
        """Return for each layer the values (width, steps * robots) of a segment; those not kept are recomputed."""
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
    """Return the steps of a segment."""
    return max(1, min(steps, SEGMENT_COLUMNS // robots))


def kept_layers(nets: Sequence[Layers], columns: int, room: int) -> list[list[bool]]:
    """Decide for each net whether the values of its input and of each layer are kept.

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
    """Allocate the values of each net along a rollout: at most ``room`` numbers; 0 if there is no gradient."""
    length = segment_length(robots, steps)
    if room == 0:
        return [NetValues(net, robots, 1, [False] * len(net.widths), 1) for net in nets]
    kept = kept_layers(nets, robots * steps, room)
    return [NetValues(net, robots, steps, own, length) for net, own in zip(nets, kept, strict=True)]
