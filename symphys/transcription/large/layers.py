"""A net over a batch: forwards, backwards, and the gradient of its weights as one product for many steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.controllers import Net
from symphys.controllers.net import Activation

Array = NDArray[Any]


class Layers:
    """A net with its weights in one precision; the arrays of a layer's values end in its width."""

    def __init__(self, net: Net, weights: Array, real: Any) -> None:
        """``real``: numpy.float64 or float32."""
        self.net, self.real, self.layers = net, real, tuple(net.layers())
        weights = weights.astype(real)
        self.matrices = [weights[layer.matrix].reshape(layer.outputs, layer.inputs) for layer in self.layers]
        self.biases = [weights[layer.biases] for layer in self.layers]
        self.straight = weights[net.straight].reshape(net.outputs, net.senses) if net.skip else None

    def forward(self, sensed: Array) -> list[Array]:
        """(..., n) -> what is sensed, then the values of every layer, of the last one before ``skip`` is added."""
        values = [np.asarray(sensed, self.real)]
        for layer, matrix, bias in zip(self.layers, self.matrices, self.biases, strict=True):
            raw = values[-1] @ matrix.T
            if bias.size:
                raw += bias
            values.append(activate(layer.activation, raw))
        return values

    def outputs(self, values: Sequence[Array]) -> Array:
        """(..., m) from the values of ``forward``."""
        return values[-1] if self.straight is None else values[-1] + values[0] @ self.straight.T

    def pull(self, values: Sequence[Array], adjoint: Array) -> tuple[Array, list[Array]]:
        """Backwards through the net.

        Args:
            values: of ``forward``.
            adjoint: (..., m) of the outputs.

        Returns:
            The adjoint (..., n) of what is sensed, and those of every layer before its activation.
        """
        back = np.asarray(adjoint, self.real)
        sensed = 0.0 if self.straight is None else back @ self.straight
        deltas = []
        for layer, matrix, value in zip(
            reversed(self.layers), reversed(self.matrices), reversed(values[1:]), strict=True
        ):
            deltas.append(back * slope(layer.activation, value))
            back = deltas[-1] @ matrix
        return back + sensed, deltas[::-1]

    def gradient(self, values: Sequence[Array], deltas: Sequence[Array], adjoint: Array) -> Array:
        """(w,) of all weights: a product a layer over all that lies in the leading axes (..., width)."""
        flat = [value.reshape(-1, value.shape[-1]) for value in values]
        parts = []
        for layer, value, delta in zip(self.layers, flat, deltas, strict=False):
            rows = delta.reshape(-1, layer.outputs)
            parts.append((rows.T @ value).ravel())
            if self.net.biases:
                parts.append(rows.sum(axis=0))
        if self.straight is not None:
            parts.append((np.asarray(adjoint, self.real).reshape(-1, self.net.outputs).T @ flat[0]).ravel())
        return np.concatenate(parts).astype(float)


def activate(activation: Activation, raw: Array) -> Array:
    """The activation of every number; ``raw`` may be written over."""
    if activation == "tanh":
        return np.tanh(raw, out=raw)
    return np.maximum(raw, 0, out=raw) if activation == "relu" else raw


def slope(activation: Activation, value: Array) -> Array | float:
    """Of an activation where its value is this."""
    if activation == "tanh":
        return 1 - value * value
    return (value > 0).astype(value.dtype) if activation == "relu" else 1.0
