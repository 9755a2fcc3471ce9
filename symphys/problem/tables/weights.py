"""Weights of nets: random ones, and those in files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from symphys.model.controllers import Net
from symphys.problem.reading.faults import Faults, Place

Array = NDArray[np.float64]


def random_weights(net: Net, spread: float, seed: int) -> Array:
    """(w,) normally distributed, with a standard deviation of spread / sqrt(inputs of the layer); biases are 0."""
    rng = np.random.default_rng(seed)
    weights = np.zeros(net.sizes["weights"])
    for layer in net.layers():
        count = layer.matrix.stop - layer.matrix.start
        weights[layer.matrix] = spread / np.sqrt(layer.inputs) * rng.standard_normal(count)
    straight = weights[net.straight]
    straight[:] = spread / np.sqrt(net.senses) * rng.standard_normal(straight.size)
    return weights


def read_weights(faults: Faults, place: Place, name: str, net: Net) -> Array:
    """(w,) from a .npy file, whose path is relative to the file that names it; zeros after a fault."""
    path = Path(faults.origin(place).file).parent / name
    count = net.sizes["weights"]
    try:
        array = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        reason = getattr(error, "strerror", None) or "it is no .npy file of numbers"
        faults.add(place, f"{path} cannot be read: {reason}")
        return np.zeros(count)
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiu":
        faults.add(place, f"{path} does not hold one array of numbers")
    elif array.size != count or array.ndim != 1:
        layers = ", ".join(f"{layer.outputs} x {layer.inputs}" for layer in net.layers())
        text = f"has the shape {array.shape}; the net has {count} weights, so ({count},) is needed: matrices {layers}"
        faults.add(place, f"{path} {text}{' with biases' if net.biases else ''}")
    elif not np.isfinite(array).all():
        k = int(np.argmax(~np.isfinite(array)))
        faults.add(place, f"{path} holds numbers that are not finite; the first is number {k}")
    else:
        return array.astype(float)
    return np.zeros(count)
