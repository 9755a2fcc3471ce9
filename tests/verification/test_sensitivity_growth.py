"""How changes grow: known in free flight, and exponential in a billiard."""

from __future__ import annotations

import numpy as np
import pytest

from symphys.findings.advice import advice
from symphys.findings.examination import Examination, Growth
from symphys.findings.levels import BAD, GOOD, Judged
from symphys.findings.numerics import GROWTH_LIMITS, growth_finding, reach
from symphys.verification.sensitivity_growth import backwards, sensitivity_growth, state_columns

FLIGHT = """
title = "Free flight"
[simulation]
duration = 1.0
dt = 0.05
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 2.0
position = [0, 0, 9]
[ground]
[[variable]]
name = "throw"
sets = "ball.velocity"
guess = [1, 0, 0]
[[target]]
name = "there"
value = "ball.position[0] - 1"
tolerance = 0.01
"""

BILLIARD = """
title = "A puck between two posts"
[simulation]
duration = 4.2
dt = 0.01
[world]
gravity = [0, 0, 0]
[contact]
friction = 0
restitution = 1
[[body]]
name = "puck"
shape = { sphere = { radius = 0.1 } }
mass = 1
position = [0, 0, 0]
[[body]]
name = "left"
shape = { sphere = { radius = 0.3 } }
mass = 1e9
position = [-1, 0, 0]
[[body]]
name = "right"
shape = { sphere = { radius = 0.3 } }
mass = 1e9
position = [1, 0, 0]
[[variable]]
name = "push"
sets = "puck.velocity[0:2]"
guess = [2, 0]
[[target]]
name = "there"
value = "puck.position[1] - 0.1"
tolerance = 0.01
"""
JUDGED = Judged(1.0, 2.0, False, True)


def test_free_flight(make):
    """The end's position moves by 1 for a position, by T - t for a velocity; its velocity by 1 for a velocity."""
    flight = make(FLIGHT)
    record = flight.record(flight.shooting.start(0))
    x, vx = 0, 7
    ends = np.zeros((len(state_columns(flight.rollout)), 2))
    ends[x, 0] = ends[vx, 1] = 1
    for k, swept in backwards(flight, record, ends):
        expected = ends.copy()
        expected[vx, 0] = 1 - 0.05 * k
        assert swept == pytest.approx(expected, abs=1e-12)


@pytest.mark.slow
def test_growth_is_the_norm_of_the_derivative_where_all_directions_are_swept(make, monkeypatch):
    flight = make(FLIGHT)
    monkeypatch.setattr("symphys.verification.sensitivity_growth.DIRECTIONS", 99)
    found = sensitivity_growth(flight, flight.record(flight.shooting.start(0)))
    for time, factor in zip(found["time"], found["factor"], strict=True):
        block = np.array([[1, 1 - time], [0, 1]])
        if time < 1:
            assert factor == pytest.approx(np.linalg.norm(block, 2), rel=1e-9)


def test_a_few_directions_estimate_it_from_below(make, monkeypatch):
    flight = make(FLIGHT)
    record = flight.record(flight.shooting.start(0))
    few = sensitivity_growth(flight, record)["factor"][0]
    monkeypatch.setattr("symphys.verification.sensitivity_growth.DIRECTIONS", 99)
    every = sensitivity_growth(flight, record)["factor"][0]
    assert every / 3 < few <= every * (1 + 1e-9)


@pytest.mark.slow
def test_billiards_grow_exponentially_and_the_advice_says_so(make):
    """Each flight of length l between discs that curve like R magnifies by L + sqrt(L^2 - 1), L = 1 + l / R."""
    billiard = make(BILLIARD)
    found = sensitivity_growth(billiard, billiard.record(billiard.shooting.start(0)))
    time, factor = np.array(found["time"]), np.array(found["factor"])
    flight, curvature, speed = 1.2, 0.4, 2.0
    ratio = 1 + flight / curvature
    expected = np.log(ratio + np.sqrt(ratio**2 - 1)) / (flight / speed)
    inside = (time > 0.4) & (time < 3.6)
    rate = -np.polyfit(time[inside], np.log(factor[inside]), 1)[0]
    assert rate == pytest.approx(expected, rel=0.05)
    curve = Growth(time, factor)
    far = reach(curve)
    assert far.total > 1e5
    assert far.doubling == pytest.approx(np.log(2) / expected, rel=0.2)
    assert growth_finding(curve).level == BAD
    text = advice(Examination(growth=curve), JUDGED)
    assert "not to be trusted beyond" in text and "shorten the horizon" in text


def test_where_a_gradient_ends():
    """Growth e^(5 t): it exceeds the limit after log(limit) / 5, wherever the rest is quiet."""
    time = np.linspace(0, 10, 1001)
    curve = Growth(time, np.exp(5 * np.maximum(3 - time, 0)))
    far = reach(curve)
    assert far.end == pytest.approx(np.log(GROWTH_LIMITS[1]) / 5, abs=0.02)
    assert far.doubling == pytest.approx(np.log(2) / 5, rel=0.05)
    assert reach(Growth(time, np.ones(1001))).end == np.inf
    assert growth_finding(Growth(time, 11 - time)).level == GOOD


def test_lost_derivatives_are_told():
    curve = Growth(np.array([0.0, 1, 2]), np.array([np.nan, np.nan, 1]))
    assert growth_finding(curve).level == BAD
    assert "before t = 2 s" in growth_finding(curve).meaning
