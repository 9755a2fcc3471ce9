"""CMA-ES finds the drop whose bounces fit, where the plain fit ends at one that bounces too late."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from tools.repeats import few

import symphys

NOISE, HEIGHT = 0.002, 0.4
"""[m]"""


def dropped(height: float) -> dict[str, Any]:
    ball = {"name": "ball", "shape": {"sphere": {"radius": 0.05}}, "mass": 0.2, "position": [0, 0, height]}
    simulation = {"duration": 1.5, "dt": 0.01}
    return {"simulation": simulation, "body": [ball], "ground": {"friction": 0.3, "restitution": 0.9}}


@cache
def measured() -> tuple[list[float], list[float]]:
    """Times and heights of the last half second, by when the ball has bounced twice."""
    places = symphys.simulate(symphys.load(dropped(HEIGHT)))["ball.position"]
    rows = np.arange(100, 150, 2)
    z = places[rows, 2] + NOISE * np.random.default_rng(0).standard_normal(len(rows))
    return (rows * 0.01).tolist(), z.tolist()


def from_height(guess: float) -> symphys.Problem:
    """The height of the drop is to be found, from a guess."""
    time, z = measured()
    height = {"name": "height", "sets": "ball.position[2]", "guess": guess, "lower": 0.1, "upper": 2.0, "scale": 0.1}
    quantity = {"value": "ball.position[2]", "columns": "z", "noise": NOISE}
    recording = {"name": "drop", "table": {"time": time, "z": z}, "measured": [quantity]}
    return symphys.load(dropped(guess) | {"variable": [height], "recording": [recording]})


@pytest.mark.slow
@few(("guess", "wrong"), [(0.2, 0.265), (1.0, 0.885)], 1)
def test_the_check_finds_the_drop_that_bounces_as_measured(guess: float, wrong: float) -> None:
    plain = symphys.identify(from_height(guess), threads=1)
    assert plain.status == "converged" and plain["height"].value == pytest.approx(wrong, abs=0.01)
    assert plain.doubts and plain.quantities[0].verdict == "missing effect"
    found = symphys.identify(from_height(guess), threads=1, check="cma", check_evaluations=200)
    assert found["height"].lower < HEIGHT < found["height"].upper and not found.doubts
    assert found.search is not None and found.search.lower and found.search.merit == plain.merit
    assert "the fit was in a local one" in found.search.text and found.search.found < plain.merit / 1000


@pytest.mark.slow
def test_where_the_fit_is_right_the_check_agrees() -> None:
    found = symphys.identify(from_height(0.7), threads=1, check="cma", check_evaluations=200)
    assert found["height"].lower < HEIGHT < found["height"].upper
    assert found.search is not None and not found.search.lower and "nothing lower" in found.search.text
