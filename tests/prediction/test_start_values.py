"""A number without a slope at its guess begins where it has one, and the result says so."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import symphys
from symphys.identification import FitOptions, IdentificationOptions, identify
from symphys.identification.fitting.fit import values_to_try
from symphys.identification.interface import fit_parameters
from symphys.prediction import residuals_of
from symphys.results.identification import Identification, summary

NOISE = 0.001
"""[m]"""


def sliding(friction: float) -> dict[str, Any]:
    """A ball that hits the ground at a slant: above a friction of about 0.1 it sticks and rolls on."""
    ball = {"name": "ball", "shape": {"sphere": {"radius": 0.05}}, "mass": 0.2, "position": [0, 0, 0.3]}
    simulation = {"duration": 0.8, "dt": 0.01}
    ground = {"friction": friction, "restitution": 0.6}
    return {"simulation": simulation, "body": [ball | {"velocity": [1.5, 0, 0]}], "ground": ground}


def recorded(*more: dict[str, Any]) -> symphys.Problem:
    """Measured with a friction of 0.05; the fit begins where the ball sticks."""
    places = symphys.simulate(symphys.load(sliding(0.05)))["ball.position"][:-1]
    places = places + NOISE * np.random.default_rng(0).standard_normal(places.shape)
    variables = [
        {"name": "friction", "sets": "ground.friction", "guess": 1.0, "lower": 0.01, "upper": 2.0},
        {"name": "bounce", "sets": "ground.restitution", "guess": 0.5, "lower": 0.0, "upper": 0.98},
        *more,
    ]
    measured = [{"value": "ball.position", "columns": "p", "noise": NOISE}]
    recording = {"name": "throw", "rate": 100, "table": {"p": places.tolist()}, "measured": measured}
    return symphys.load(sliding(1.0) | {"variable": variables, "recording": [recording]})


def found(start_values: bool, *more: dict[str, Any]) -> Identification:
    options = IdentificationOptions(fit=FitOptions(start_values=start_values), draws=0)
    return identify(residuals_of(recorded(*more), threads=1), options)


@pytest.mark.slow
def test_a_ball_that_sticks_at_the_guess_is_fitted_where_it_slides() -> None:
    stuck = found(False)
    assert stuck["friction"].value == 1.0 and np.isinf(stuck["friction"].error) and not stuck.starts
    free = found(True)
    assert free["friction"].lower < 0.05 < free["friction"].upper and free["friction"].error < 1e-3
    assert free.merit < stuck.merit / 10
    (note,) = free.starts
    assert note.startswith("friction has no effect on what was measured at its guess, 1: the fit begins at 0.")
    assert note in summary(free)


@pytest.mark.slow
def test_a_number_without_an_effect_anywhere_stays_at_its_guess() -> None:
    mass = {"name": "mass", "sets": "ball.mass", "guess": 0.3, "lower": 0.05, "upper": 3.0}
    both = found(True, mass)
    assert both["mass"].value == pytest.approx(0.3) and both["friction"].value == pytest.approx(0.05, abs=1e-3)
    assert both.starts[1].startswith("mass has no effect on what was measured at its guess, 0.3, and none of")


def test_values_lie_between_the_bounds_on_both_sides_of_the_guess() -> None:
    bounded = fit_parameters(("friction",), [1.0], lower=0.01, upper=2.0)
    assert values_to_try(bounded, 0)[0] == 0.01 and max(values_to_try(bounded, 0)) == 2.0
    assert 1.0 not in values_to_try(bounded, 0)
    free = values_to_try(fit_parameters(("place",), [0.0], scale=0.2), 0)
    assert free[0] == -free[-1] == pytest.approx(-1.8) and len(free) == 10
