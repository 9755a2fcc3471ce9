"""Boards that lie flush, tiles and low steps: what comes over a seam meets the top of the next block, not its side."""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few, first, thorough
from worlds.blocks import block, rod, turned_by

from symphys.dynamics.functions import step_function
from symphys.model.shapes import Box, Fixture
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Body, Law, Scheme, make_world
from symphys.types import Array

HALF, RADIUS, FRICTION, GRAVITY = 0.05, 0.03, 0.2, 9.81
SEAM = 0.5
"""[m] x at which the second board begins."""
TURNED = tuple(turned_by((0, 0, 1), np.pi / 2))


def bodies() -> dict[str, Body]:
    """A cube, a ball, a capsule."""
    return {
        "cube": block("it", (HALF, HALF, HALF)),
        "ball": Body.ball("it", RADIUS, 0.1),
        "rod": rod("it", RADIUS, 0.1),
    }


class Boards:
    """A body over two boards; the numbers of the second are parameters of its step, built without Newton's start."""

    def __init__(self, kind: str, tiles: bool = False):
        self.numbers = [ca.SX.sym(name) for name in ("dt", "higher", "gap")]
        self.dt, higher, gap = self.numbers
        sides = ((-0.5, 0.5) if tiles else (0.0,), 0.5 if tiles else 1.0)
        blocks = [
            Fixture(f"{name}{y}", Box((1.0, sides[1], 0.1), (x, y, z)))
            for name, x, z in (("first", SEAM - 1, -0.1), ("second", SEAM + 1 + gap, higher - 0.1))
            for y in sides[0]
        ]
        world = make_world([bodies()[kind]], blocks, Law(FRICTION))
        self.layout, self.world = Layout(world), world

    @cache  # noqa: B019
    def step(self, sweeps: int, newton: bool) -> ca.Function:
        return step_function(self.world, Scheme(dt=self.dt, sweeps=sweeps, newton_start=newton), (), self.numbers)

    def states(
        self,
        start: dict[str, Any],
        time: float,
        dt: float = 0.005,
        higher: float = 0.0,
        gap: float = 0.0,
        sweeps: int = 20,
        newton: bool = False,
    ) -> dict[str, Array]:
        """Position, velocity, turning of the body: (steps + 1, 3) each."""
        x, found = initial_state(self.world, {f"it.{name}": value for name, value in start.items()}), []
        for _ in range(round(time / dt)):
            found.append(x)
            x = self.step(sweeps, newton)(x, ca.DM(0, 1), [dt, higher, gap], 0)
        columns = np.array(ca.horzcat(*found, x)).T
        names = ("position", "velocity", "angular_velocity")
        return {name: columns[:, self.layout[f"it.{name}"]] for name in names}


@cache
def boards(kind: str, tiles: bool = False) -> Boards:
    return Boards(kind, tiles)


def slid(speed: float, time: float) -> float:
    """How far a box slides on one board [m]."""
    return speed * time - FRICTION * GRAVITY * time**2 / 2


def sliding(speed: float, ahead: float = 0.02, yaw: float = 0.0) -> dict[str, Any]:
    """The start of a cube whose front is ``ahead`` of the seam [m]."""
    return {
        "position": [SEAM - HALF - ahead, 0, HALF],
        "velocity": [speed, 0, 0],
        "orientation": turned_by((0, 0, 1), yaw),
    }


LEVEL = (0.0, 1e-12, -1e-12, 1e-9, -1e-9, 1e-6, -1e-6)
UNEVEN = (1e-4, -1e-4, 1e-3, -1e-3)


@pytest.mark.slow
@few(("sweeps", "newton"), [(20, True), thorough(20, False), *(thorough(n, True) for n in (4, 10, 14, 50, 200))], 1)
@pytest.mark.parametrize("higher", [*LEVEL[:1], LEVEL[5], *map(thorough, (*LEVEL[1:5], *LEVEL[6:]))])
@pytest.mark.parametrize(
    ("speed", "dt"), [(3.0, 0.005), thorough(0.3, 0.005), thorough(1.0, 0.02), thorough(10.0, 0.01)]
)
def test_a_box_slides_over_a_seam_as_on_one_board(
    sweeps: int, newton: bool, higher: float, speed: float, dt: float
) -> None:
    """By the closed form of sliding friction, without turning; a corner that struck a side stopped the box."""
    time, start = round(min(0.12, speed / 2.5) / dt) * dt, sliding(speed, min(0.02, speed / 20))
    it = boards("cube").states(start, time, dt, higher, sweeps=sweeps, newton=newton)
    assert it["position"][-1, 0] - start["position"][0] == pytest.approx(slid(speed, time), abs=1e-5)
    assert np.abs(it["angular_velocity"]).max() < 0.05
    assert it["position"][-1, 2] == pytest.approx(HALF + higher, abs=2e-6)


@pytest.mark.slow
@pytest.mark.parametrize("higher", [*UNEVEN[:1], UNEVEN[2], *map(thorough, (UNEVEN[1], UNEVEN[3]))])
@first("sweeps", [20, 4, 200])
@first("speed", [3.0, 1.0, 10.0])
def test_a_box_goes_over_a_step_of_up_to_a_millimetre(sweeps: int, higher: float, speed: float) -> None:
    """It tips a little. It loses no more speed than on the flat and what the climb costs, and gains no energy."""
    start, time = sliding(speed), 0.15
    it = boards("cube").states(start, time, higher=higher, sweeps=sweeps)
    flat = speed - FRICTION * GRAVITY * time
    lift = GRAVITY * max(higher, 0.0)
    assert it["velocity"][-1, 0] > flat - 15 * lift / speed
    assert it["position"][-1, 0] > SEAM + HALF / 2
    energy = (
        (it["velocity"] ** 2).sum(1) / 2
        + GRAVITY * it["position"][:, 2]
        + (it["angular_velocity"] ** 2).sum(1) * HALF**2 / 3
    )
    assert np.diff(energy).max() < max(1.1 * lift, 1e-6) + 1e-3 * speed**2 / 2


@pytest.mark.slow
@pytest.mark.parametrize("gap", [1e-3, *map(thorough, (-1e-3, -1e-6, -1e-9, 1e-9, 1e-6, 1e-4))])
@first("yaw", [0.5, 0.0, 0.1, np.pi / 4])
def test_boards_may_overlap_or_leave_a_gap(gap: float, yaw: float) -> None:
    """The same motion, of a box in any direction."""
    start = sliding(3.0, 0.05, yaw)
    it = boards("cube").states(start, 0.1, gap=gap)
    assert it["position"][-1] - start["position"] == pytest.approx([slid(3.0, 0.1), 0, 0], abs=1e-5)


@pytest.mark.thorough
@pytest.mark.parametrize("y", [0.0, 0.02])
@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_a_box_slides_over_the_corner_of_four_tiles(y: float, yaw: float) -> None:
    start = sliding(3.0, 0.05, yaw) | {"velocity": [3.0, 0.3, 0]}
    start["position"][1] = y
    it = boards("cube", tiles=True).states(start, 0.1)
    along = slid(np.hypot(3.0, 0.3), 0.1) / np.hypot(3.0, 0.3)
    assert it["position"][-1] - start["position"] == pytest.approx([3 * along, 0.3 * along, 0], abs=2e-5)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ball", thorough("rod")])
@pytest.mark.parametrize("shift", [0.0, 0.3, 0.7])
@first("dt", [0.02, 0.01, 0.005])
@first("speed", [1.0, 0.3, 3.0])
def test_what_rolls_goes_on_as_fast_beyond_a_seam(kind: str, shift: float, dt: float, speed: float) -> None:
    """Wherever the seam lies within the step; on the predicted path a ball sinks, and struck the rim."""
    place = SEAM - speed * dt * (3 + shift)
    start = {"position": [place, 0, RADIUS], "velocity": [speed, 0, 0], "angular_velocity": [0, speed / RADIUS, 0]}
    it = boards(kind).states(start | ({"orientation": TURNED} if kind == "rod" else {}), 8 * dt, dt)
    assert it["velocity"][-1] == pytest.approx([speed, 0, 0], abs=1e-4 * speed if kind == "rod" else 1e-12)
    assert it["position"][-1] == pytest.approx([place + 8 * dt * speed, 0, RADIUS], abs=5e-6)


@pytest.mark.thorough
@pytest.mark.parametrize("dt", [0.005, 0.01, 0.02])
@pytest.mark.parametrize("speed", [0.3, 1.0, 3.0])
def test_a_capsule_slides_end_first_over_a_seam(dt: float, speed: float) -> None:
    start = {"position": [SEAM - RADIUS - 0.1 - 2.4 * speed * dt, 0, RADIUS], "velocity": [speed, 0, 0]}
    time = 6 * dt
    it = boards("rod").states(start, time, dt)
    assert it["velocity"][-1] == pytest.approx([speed - FRICTION * GRAVITY * time, 0, 0], abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "high"), [("cube", 0.02), ("ball", 0.04), thorough("cube", 0.005), thorough("rod", 0.04)]
)
def test_a_riser_stops_what_runs_into_it(kind: str, high: float) -> None:
    """A stair: the box loses its speed at once and may tip, the ball comes to a stand."""
    size = HALF if kind == "cube" else RADIUS
    start = {"position": [SEAM - size - 0.02, 0, size], "velocity": [3.0, 0, 0], "orientation": [1, 0, 0, 0]}
    if kind == "rod":
        start |= {"orientation": TURNED}
    it = boards(kind).states(start, 0.05, higher=high)
    assert it["velocity"][3:, 0].max() < 1.6
    assert it["position"][:, 0].max() < SEAM


@pytest.mark.slow
@pytest.mark.parametrize(("z", "down"), [(0.0, 0.0), (0.03, -3.0), thorough(0.045, -0.5)])
@first("dt", [0.005, 0.02])
def test_a_box_that_falls_past_an_edge_meets_the_side(z: float, down: float, dt: float) -> None:
    """From beyond a wide gap: it comes below the top, is stopped by the side, and falls along it."""
    start = {"position": [1.0, 0, z], "velocity": [3.0, 0, down]}
    it = boards("cube").states(start, 0.2, dt, gap=0.7)
    assert it["position"][-1, 0] == pytest.approx(SEAM + 0.7 - HALF, abs=2e-4)
    struck = min(down - GRAVITY * 0.05 + FRICTION * 3.0, 0.0)  # friction takes its share of the impulse, at most all
    assert it["velocity"][-1] == pytest.approx([0, 0, struck - GRAVITY * 0.15], abs=2e-3)


@pytest.mark.slow
@few("beside", [0.0, -1e-4, 1e-4], 1)
def test_a_box_lands_on_a_seam(beside: float) -> None:
    """At speed, so that its front comes over the seam as it lands."""
    start = sliding(3.0, -beside) | {
        "position": [SEAM - HALF - 0.03 + beside, 0, HALF + 0.005],
        "velocity": [3.0, 0, -0.5],
    }
    it = boards("cube").states(start, 0.1)
    assert it["velocity"][-1, 0] > 3 - FRICTION * (0.6 + GRAVITY * 0.1)
    assert it["position"][-1, 2] == pytest.approx(HALF, abs=1e-6)
    assert np.abs(it["angular_velocity"][-1]).max() < 1e-3


@pytest.mark.slow
def test_a_slope_over_a_seam_is_finite_and_that_of_the_closed_form() -> None:
    """How far a box slides by its speed at the start: the time, whatever lies below."""
    cube, speed = boards("cube"), ca.MX.sym("v")
    step = cube.step(20, newton=False)
    x = initial_state(
        cube.world, {"it.position": [SEAM - HALF - 0.02, 0, HALF], "it.velocity": ca.vertcat(speed, 0, 0)}
    )
    for _ in range(12):
        x = step(x, ca.DM(0, 1), [0.005, 0.0, 0.0], 0)
    place = x[cube.layout["it.position"]][0]
    found = ca.Function("slope", [speed], [place, ca.gradient(place, speed)])
    value, slope = (float(each) for each in found(3.0))
    assert value - (SEAM - HALF - 0.02) == pytest.approx(slid(3.0, 0.06), abs=1e-5)
    assert slope == pytest.approx(0.06, abs=1e-4)
