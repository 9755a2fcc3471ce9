"""Impacts that follow one another within a step, and such as come at one instant."""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few

from symphys.dynamics.functions import report_function
from symphys.model.shapes import Plane
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Body, Law, Scheme, World, make_world

RADIUS, START = 0.05, -0.5


@cache
def row_of_balls(e: float, count: int, scheme: Scheme) -> tuple[World, ca.Function]:
    """The balls, and a second of their motion."""
    balls = [Body.ball(f"b{k}", RADIUS, 1.0) for k in range(count)]
    world = make_world(balls, law=Law(0.0, e), gravity=(0, 0, 0))
    return world, report_function(world, scheme).mapaccum(round(1 / scheme.dt))


class Cradle:
    """Balls in a row, ``gap`` [m] apart, hit by the first at ``speed`` [m/s], for a second."""

    def __init__(self, gap: float, scheme: Scheme, e: float = 1.0, count: int = 5, speed: float = 1.0):
        world, step = row_of_balls(e, count, scheme)
        layout, start = Layout(world), {"b0.position": [START, 0, 0], "b0.velocity": [speed, 0, 0]}
        start |= {f"b{k}.position": [k * (2 * RADIUS + gap), 0, 0] for k in range(1, count)}
        columns = [layout[f"b{k}.velocity"].start for k in range(count)]
        args = (ca.DM.zeros(n, round(1 / scheme.dt)) for n in (0, 0, 1))
        found = dict(zip(step.name_out(), step(initial_state(world, start), *args), strict=True))
        speeds = np.array(found["x_next"])[columns]
        self.speeds, self.energy = speeds[:, -1], (speeds**2).sum(axis=0) / 2
        self.crowded, self.ambiguous = (int(np.array(found[name]).sum()) for name in ("crowded", "ambiguous"))


@pytest.mark.slow
@pytest.mark.parametrize("gap", [1e-3, 1e-4, 1e-6])
def test_a_cradle_with_gaps_hands_the_blow_on(gap: float) -> None:
    """Elastic balls of equal mass exchange velocities, one pair after the other: (0, 0, 0, 0, 1) (Newton)."""
    cradle = Cradle(gap, Scheme(dt=0.01))
    assert cradle.speeds == pytest.approx([0, 0, 0, 0, 1], abs=1e-9)
    assert cradle.crowded > 0  # some of it came late, and that is said
    assert cradle.ambiguous == 0


@pytest.mark.thorough
def test_enough_cuts_or_a_small_step_resolve_it_in_time() -> None:
    """Four impacts 1 ms apart."""
    assert Cradle(1e-3, Scheme(dt=0.01, cuts=4)).crowded == 0
    assert Cradle(1e-3, Scheme(dt=0.0005)).crowded == 0


@pytest.mark.slow
@few("e", [0.0, 0.5, 1.0], 1)
@few("speed", [1.0, 3.0, 10.0], 2)
@few("gap", [0.0, 1e-3, 5e-3], 2)
def test_a_chain_adds_no_energy(gap: float, speed: float, e: float) -> None:
    """However fast the blow is beside a ball's size in a step."""
    cradle = Cradle(gap, Scheme(dt=0.01), e, speed=speed)
    assert np.diff(cradle.energy).max() < 1e-9 * speed**2
    assert cradle.speeds.sum() == pytest.approx(speed)


@few(("gap", "e", "named"), [(0.0, 1.0, True), (0.0, 0.0, False), (1e-3, 1.0, False)], 1)
def test_impacts_at_one_instant_are_named(gap: float, e: float, named: bool) -> None:
    """Touching balls that rebound have no one answer; plastic ones, and such with gaps, have."""
    assert (Cradle(gap, Scheme(dt=0.01), e).ambiguous > 0) is named


def test_a_ball_into_a_square_corner_is_not_ambiguous() -> None:
    """Both walls at once, but neither impact acts on the other."""
    walls = [Plane("floor", (0, 0, 1), 0.0), Plane("wall", (-1, 0, 0), 0.0)]
    world = make_world([Body.ball("ball", RADIUS, 1.0)], walls, Law(0.0, 1.0), (0, 0, 0))
    start = {"ball.position": [-0.057, 0, 0.057], "ball.velocity": [1, 0, -1]}
    found = report_function(world, Scheme(dt=0.01)).call(
        {"x": initial_state(world, start), "u": ca.DM(0, 1), "p": ca.DM(0, 1), "smoothing": 0}
    )
    velocity = np.array(found["x_next"]).ravel()[Layout(world)["ball.velocity"]]
    assert velocity == pytest.approx([-1, 0, 1], abs=1e-9)
    assert float(found["ambiguous"]) == 0
