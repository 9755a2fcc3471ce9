"""In the last substep a body takes its first impact; its later ones wait for the next step."""

from __future__ import annotations

import casadi as ca
import pytest

from symphys.dynamics.context import make_context
from symphys.dynamics.functions import parts_of
from symphys.dynamics.impact.impact import defer_impacts
from symphys.model.shapes import Plane
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Body, Law, Scheme, make_world

RADIUS, DT = 0.1, 0.01


def suppressed(restitution: float, gaps: tuple[float, float]) -> list[float]:
    """Of a ball that flies at 1 m/s towards a floor and a wall, that far from them."""
    walls = [Plane.ground(), Plane("wall", (-1.0, 0.0, 0.0), -1.0)]
    world = make_world([Body.ball("ball", RADIUS, 1.0)], walls, Law(0.0, restitution), gravity=(0.0, 0.0, 0.0))
    context = make_context(world, Scheme(dt=DT), (), ca.SX(0, 1), ca.SX(0))
    place = (1.0 - RADIUS - gaps[1], 0.0, RADIUS + gaps[0])
    x = initial_state(world, {"ball.position": place, "ball.velocity": (1.0, 0.0, -1.0)})
    found = defer_impacts(context, parts_of(Layout(world), ca.SX(x)), ca.SX(DT), [])
    return [float(ca.DM(each)) for each in found.suppressed]


@pytest.mark.parametrize(("gaps", "waits"), [((0.002, 0.006), [0, 1]), ((0.006, 0.002), [1, 0])])
def test_the_later_of_two_rebounds_waits(gaps: tuple[float, float], waits: list[float]) -> None:
    assert suppressed(0.5, gaps) == waits


def test_without_rebound_both_act() -> None:
    """A ball about its centre gains no energy from two plastic impacts at once."""
    assert suppressed(0.0, (0.002, 0.006)) == [0, 0]


def test_what_is_not_reached_gives_no_impulse() -> None:
    """It closes at speed, but does not meet within the substep."""
    assert suppressed(0.5, (0.002, 0.05)) == [0, 1]
