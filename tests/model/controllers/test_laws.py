"""Laws of controllers against numpy, written out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np
import pytest

from symphys.model.controllers import ControlLaw, Linear, Net, Periodic
from symphys.types import Array

RNG = np.random.default_rng(4)


def act(law: ControlLaw, sensed: Array, time: float, numbers: Mapping[str, Array]) -> Array:
    """The outputs as numbers, by way of SX."""
    symbols = {key: ca.SX.sym(key, size) for key, size in law.sizes.items()}
    o, t = ca.SX.sym("o", law.senses), ca.SX.sym("t")
    function = ca.Function("act", [o, t, *symbols.values()], [law.act(o, t, symbols)])
    return np.array(function(sensed, time, *(numbers[key] for key in symbols))).ravel()


def numbers_for(law: ControlLaw) -> dict[str, Array]:
    """Random ones."""
    return {key: RNG.standard_normal(size) for key, size in law.sizes.items()}


def test_linear() -> None:
    """K o + b with K row by row."""
    law, o = Linear(3, 2), np.array([0.5, -1.0, 2.0])
    numbers = numbers_for(law)
    expected = numbers["gains"].reshape(2, 3) @ o + numbers["offsets"]
    assert np.allclose(act(law, o, 0.0, numbers), expected, rtol=1e-14)


def test_periodic() -> None:
    """Offsets, sines and cosines of f and 2 f, for two outputs."""
    law, t = Periodic(2, harmonics=2), 0.37
    n = numbers_for(law)
    expected = n["offsets"].copy()
    for h in (1, 2):
        phase = 2 * np.pi * h * n["frequency"] * t
        part = slice(2 * (h - 1), 2 * h)
        expected += n["sines"][part] * np.sin(phase) + n["cosines"][part] * np.cos(phase)
    assert np.allclose(act(law, np.zeros(0), t, n), expected, rtol=1e-14)


@pytest.mark.parametrize("biases", [True, False])
@pytest.mark.parametrize("skip", [True, False])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_net(activation: Any, biases: bool, skip: bool) -> None:
    """Two hidden layers, bounded outputs, with and without biases and a straight matrix."""
    law = Net(3, 2, (4, 5), activation, "tanh", biases, skip)
    o, weights = np.array([0.5, -1.0, 2.0]), RNG.standard_normal(law.sizes["weights"])
    left = weights
    value = o
    squash = {"tanh": np.tanh, "relu": lambda x: np.maximum(x, 0)}[activation]
    for outputs, act_ in ((4, squash), (5, squash), (2, np.tanh)):
        matrix, left = left[: outputs * value.size].reshape(outputs, -1), left[outputs * value.size :]
        bias, left = (left[:outputs], left[outputs:]) if biases else (0.0, left)
        value = act_(matrix @ value + bias)
    if skip:
        value = value + left.reshape(2, 3) @ o
    assert np.allclose(act(law, o, 0.0, {"weights": weights}), value, rtol=1e-13)


def test_paper_counts() -> None:
    """The nets of Degrave et al. have 1,296, 1,147,904 (table), 17,284 (arm) and 17,952 (gait) weights.

    The last one's straight layer has 8 biases of its own, which say the same as those of the last layer.
    """
    assert Net(81, 16, biases=False).sizes["weights"] == 1296
    assert Net(81, 16, (1024, 1024), biases=False).sizes["weights"] == 1147904
    assert Net(2, 8, (128, 128), "relu", skip=True).sizes["weights"] == 17952 - 8
    assert Net(1, 4, (128, 128)).sizes["weights"] == 17284


def test_relu_has_no_slope_at_zero() -> None:
    """A unit that is exactly at its corner passes nothing on, and nothing that is not finite."""
    law, symbol = Net(1, 1, (1,), "relu", biases=False), ca.SX.sym("o")
    slope = ca.jacobian(law.act(symbol, 0, {"weights": ca.SX([1.0, 1.0])}), symbol)
    assert float(ca.Function("slope", [symbol], [slope])(0.0)) == 0.0
