"""Loads that rigid statics leaves open, and impacts on points close together: symmetric machines stay symmetric.

The law is mirror symmetry: what is symmetric and starts symmetric has no rate that its mirror image has not. It holds
for any number of sweeps and any order of the bodies.
"""

from __future__ import annotations

import tomllib
from functools import cache
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.laboratory import Lab
from worlds.blocks import block
from worlds.driven import TABLES

import symphys
from symphys.dynamics.functions import step_function
from symphys.model.shapes import Box, Fixture
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Law, Scheme, make_world
from symphys.types import Array

CRATE = (0.5, 0.5, 0.5)
CAR = """
simulation = { duration = 0.1, dt = 0.01 }
ground = { friction = 0.5 }
[[body]]
name = "hull"
mass = 4.0
inertia = [0.05, 0.1, 0.1]
position = [0, 0, 0.15]
"""
WHEEL = """
[[body]]
name = "wheel{k}"
mass = 0.5
inertia = [0.0015, 0.0015, 0.0025]
shape = {{ cylinder = {{ radius = 0.1, length = 0.04 }} }}
collides_with = ["ground"]
position = [{x}, {y}, 0.1]
orientation = {{ roll_deg = 90 }}
[[joint]]
name = "axle{k}"
between = ["hull", "wheel{k}"]
point = [{x}, {y}, 0.1]
hinge = {{ axis = [0, 1, 0] }}
motor = {{ torque = {{ torque = 10 }} }}
"""
PLACES = [(-0.2, -0.15), (-0.2, 0.15), (0.2, -0.15), (0.2, 0.15)]
FEET = """
simulation = { duration = 0.1, dt = 0.01 }
ground = { friction = 0.5 }
[[body]]
name = "hip"
mass = 5.0
inertia = 0.05
position = [0, 0, 0.5]
"""
FOOT = """
[[body]]
name = "foot{k}"
mass = 0.5
shape = {{ box = {{ size = [0.2, 0.08, 0.05] }} }}
collides_with = ["ground"]
position = [0, {y}, 0.025]
[[joint]]
name = "leg{k}"
between = ["hip", "foot{k}"]
fixed = {{}}
point = [0, {y}, 0.5]
"""


def moved(text: str, sweeps: int, reverse: bool, steps: int, torque: float = 0.0) -> dict[str, Array]:
    """(steps + 1, components) of a problem's first motion, its bodies in the other order if ``reverse``."""
    tables: dict[str, Any] = tomllib.loads(text)
    for key in ("body", "joint"):
        tables[key] = tables[key][::-1] if reverse else tables[key]
    problem = symphys.load(tables)
    world = problem.world()
    commands = [f"{joint.name}.command" for joint in world.joints if joint.driven]
    rear = [torque * (name in ("axle0.command", "axle1.command")) for name in commands]
    step, layout = step_function(world, Scheme(dt=0.01, sweeps=sweeps), commands), Layout(world)
    x = [initial_state(world, {name: list(value) for name, value in problem.initial.items()})]
    for _ in range(steps):
        x.append(step(x[-1], rear, [], 0))
    states = np.array(ca.horzcat(*x)).T
    return {name: states[:, layout[name]] for name in layout.names()}


@cache
def landing(width: float, restitution: float, sweeps: int = 10) -> Lab:
    """A crate of 1 m above a pedestal."""
    pedestal = Fixture("pedestal", Box((width / 2, width / 2, 0.25), (0, 0, -0.25)))
    law = Law(friction=0.4, restitution=restitution)
    return Lab(make_world([block("crate", CRATE)], [pedestal], law), Scheme(dt=0.01, sweeps=sweeps))


@pytest.mark.slow
@pytest.mark.parametrize(("sweeps", "reverse"), [pytest.param(4, False, marks=pytest.mark.thorough), (4, True)])
def test_a_hip_on_two_flat_feet_stands_straight(sweeps: int, reverse: bool) -> None:
    """Eight corners of two feet share the weight: no rate but those of rounding."""
    text = FEET + "".join(FOOT.format(k=k, y=y) for k, y in enumerate((-0.1, 0.1)))
    rates = moved(text, sweeps, reverse, 20)["hip.angular_velocity"]
    assert np.abs(rates).max() < 1e-9


@pytest.mark.thorough
@pytest.mark.parametrize("sweeps", [4, 10, 20])
@pytest.mark.parametrize("reverse", [False, True])
def test_a_car_on_cylinders_drives_straight(sweeps: int, reverse: bool) -> None:
    """Spinning wheels push with mu N each side; and each of the wheels carries a quarter as long as it stands."""
    text = CAR + "".join(WHEEL.format(k=k, x=x, y=y) for k, (x, y) in enumerate(PLACES))
    for torque in (0.0, 1.0):
        found = moved(text, sweeps, reverse, 50, torque)
        assert np.abs(found["hull.angular_velocity"][:, [0, 2]]).max() < 1e-9
        forces = [
            sum(found[name][-1, 2] for name in found if name.startswith(f"wheel{k}-") and name.endswith(".force"))
            for k in range(4)
        ]
        assert max(abs(a - b) for a, b in pairwise(forces[::2])) < 1e-6 or torque
        assert forces[0] == pytest.approx(forces[1], rel=1e-6)
        assert torque or forces == pytest.approx([14.715] * 4, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("restitution", [pytest.param(0.0, marks=pytest.mark.thorough), 1.0])
@pytest.mark.parametrize("width", [0.1, pytest.param(0.75, marks=pytest.mark.thorough)])
def test_a_flat_landing_on_a_narrow_pedestal_does_not_turn(width: float, restitution: float) -> None:
    """By symmetry; the points lie close together against the size of the crate."""
    found = landing(width, restitution).states({"crate.position": [0, 0, 0.6]}, 0.3)
    assert np.abs(found["crate.velocity"][:, 2]).max() > 1.3
    assert np.abs(found["crate.angular_velocity"]).max() < 1e-9


@pytest.mark.thorough
def test_landings_off_the_middle_are_those_of_many_sweeps() -> None:
    """Ten sweeps and a hundred agree where nothing is symmetric: off the centre, and tilted about two axes."""
    turn = np.array([1, 0.02, 0.01, 0])
    start = {"crate.position": [0.03, 0.01, 0.6], "crate.orientation": list(turn / np.linalg.norm(turn))}
    rates = [landing(0.2, 0.0, sweeps).states(start, 0.2)["crate.angular_velocity"] for sweeps in (10, 60)]
    assert np.abs(rates[0]).max() > 0.1
    assert rates[0] == pytest.approx(rates[1], abs=1e-3)


@pytest.mark.thorough
def test_a_crate_slides_straight_on_two_rails() -> None:
    """As far as on one: v^2 / (2 mu g)."""
    rails = [Fixture(f"rail{k}", Box((1, 0.025, 0.05), (0, y, -0.05))) for k, y in enumerate((-0.15, 0.15))]
    lab = Lab(make_world([block("b", (0.2, 0.25, 0.15))], rails, Law(0.5)), Scheme(dt=0.01, sweeps=4))
    found = lab.states({"b.position": [0, 0, 0.15], "b.velocity": [1.0, 0, 0]}, 0.3)
    assert found["b.position"][-1][0] == pytest.approx(1 / (2 * 0.5 * 9.81), abs=2e-4)
    assert np.abs(found["b.angular_velocity"]).max() < 1e-9


@pytest.mark.slow
def test_the_start_of_the_sweeps_does_not_jump() -> None:
    """Along a line on which iterates of Newton's method change places, values lie on a parabola but for rounding."""
    rollout = symphys.compile(symphys.load(TABLES), backend="casadi")
    z = np.asarray(rollout.z())
    along = np.random.default_rng(0).normal(size=z.size)
    line = np.linspace(-1e-4, 1e-4, 41)[:, None] * along / np.linalg.norm(along)
    assert np.abs(np.diff(rollout.value(z + line), 3)).max() < 1e-9
