"""A net over a batch: forwards, backwards, and the gradient of its weights as one product for many steps.

Arrays of a device know numpy's functions.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.cuda import Device
from symphys.model.controllers import Net
from symphys.model.controllers.net import Activation

Array = NDArray[Any]


class Layers:
    """A net with its weights in one precision; the arrays of a layer's values end in its width."""

    def __init__(self, net: Net, weights: Array, real: Any, device: Device | None = None) -> None:
        """``real``: numpy.float64 or float32; ``device``: where products are computed; None: here."""
        self.net, self.real, self.device, self.layers = net, real, device, tuple(net.layers())
        weights = self.put(weights)
        self.matrices = [weights[layer.matrix].reshape(layer.outputs, layer.inputs) for layer in self.layers]
        self.biases = [weights[layer.biases] for layer in self.layers]
        self.straight = weights[net.straight].reshape(net.outputs, net.senses) if net.skip else None

    def put(self, values: Array) -> Any:
        """Numbers in this precision, where products are computed."""
        own = np.asarray(values, self.real)
        return own if self.device is None else self.device.put(own)

    def get(self, values: Any) -> Array:
        """Numbers here."""
        return np.asarray(values if self.device is None else self.device.get(values))

    def forward(self, sensed: Array) -> list[Any]:
        """(..., n) -> what is sensed, then the values of every layer, of the last one before ``skip`` is added.

        They stay where they are computed, as all that is handed on between the methods does.
        """
        values = [self.put(sensed)]
        for layer, matrix, bias in zip(self.layers, self.matrices, self.biases, strict=True):
            raw = values[-1] @ matrix.T
            if bias.size:
                raw += bias
            values.append(activate(layer.activation, raw))
        return values

    def outputs(self, values: Sequence[Any]) -> Array:
        """(..., m) from the values of ``forward``."""
        return self.get(values[-1] if self.straight is None else values[-1] + values[0] @ self.straight.T)

    def pull(self, values: Sequence[Any], adjoint: Array) -> tuple[Array, list[Any]]:
        """Backwards through the net.

        Args:
            values: of ``forward``.
            adjoint: (..., m) of the outputs.

        Returns:
            The adjoint (..., n) of what is sensed, and those of every layer before its activation.
        """
        back = self.put(adjoint)
        sensed = 0.0 if self.straight is None else back @ self.straight
        deltas = []
        for layer, matrix, value in zip(
            reversed(self.layers), reversed(self.matrices), reversed(values[1:]), strict=True
        ):
            deltas.append(back * slope(layer.activation, value))
            back = deltas[-1] @ matrix
        return self.get(back + sensed), deltas[::-1]

    def gradient(self, values: Sequence[Any], deltas: Sequence[Any], adjoint: Array) -> Array:
        """(w,) of all weights: a product a layer over all that lies in the leading axes (..., width)."""
        flat = [value.reshape(-1, value.shape[-1]) for value in values]
        parts = []
        for layer, value, delta in zip(self.layers, flat, deltas, strict=False):
            rows = delta.reshape(-1, layer.outputs)
            parts.append((rows.T @ value).ravel())
            if self.net.biases:
                parts.append(rows.sum(axis=0))
        if self.straight is not None:
            parts.append((self.put(adjoint).reshape(-1, self.net.outputs).T @ flat[0]).ravel())
        return self.get(np.concatenate(parts)).astype(float)


def activate(activation: Activation, raw: Any) -> Any:
    """The activation of every number; ``raw`` may be written over."""
    if activation == "tanh":
        return np.tanh(raw, out=raw)
    return np.maximum(raw, 0, out=raw) if activation == "relu" else raw


def slope(activation: Activation, value: Any) -> Any:
    """Of an activation where its value is this."""
    if activation == "tanh":
        return 1 - value * value
    return (value > 0).astype(value.dtype) if activation == "relu" else 1.0
