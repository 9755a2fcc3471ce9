"""Cylinders, ellipsoids and hulls roll, stand, rest and rock as closed forms, statics and MuJoCo say."""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.repeats import thorough
from worlds.blocks import turned_by

from symphys.api.simulation import simulate
from symphys.export import mjcf
from symphys.maths import rotation
from symphys.model.body import Body
from symphys.model.heightfield import Heightfield
from symphys.model.shapes import Convex, Fixture, Plane, Static, Terrain
from symphys.model.shapes import Cylinder as CylinderShape
from symphys.model.world import Law, World, make_world
from symphys.problem import Problem
from symphys.trajectory import Trajectory
from symphys.types import Array

G, MASS = 9.81, 2.0
ON_SIDE = (float(np.sqrt(0.5)), float(np.sqrt(0.5)), 0.0, 0.0)
SLOPE = 0.2
RAMP = (float(np.sin(SLOPE)), 0.0, float(np.cos(SLOPE)))


def centred(points: Array) -> Convex:
    """A hull about its centre of mass."""
    return Convex(points - Convex(points).hull.centroid)


STONE = centred(np.random.default_rng(0).normal(size=(60, 3)) * [0.2, 0.15, 0.1])
FACET = np.linspace(0, 2 * np.pi, 25)[:-1]
DRUM = centred(np.array([(0.1 * np.cos(a), 0.1 * np.sin(a), z) for a in FACET for z in (-0.1, 0.1)]))


def stone(hull: Convex = STONE, **start: Any) -> Body:
    return Body.compound("it", [hull], mass=MASS, **start)


def drum(**start: Any) -> Body:
    return Body.cylinder("it", radius=0.1, length=0.2, mass=MASS, **start)


def egg(**start: Any) -> Body:
    return Body.ellipsoid("it", (0.3, 0.2, 0.1), mass=MASS, **start)


def moved(world: World, duration: float) -> Trajectory:
    return simulate(Problem.from_world(world, duration=duration))


def axes(motion: Trajectory, k: int) -> Array:
    """(3, 3): R_wb of the first body."""
    return np.array(rotation.matrix(ca.DM(motion.orientation[k, 0])))


def is_still(motion: Trajectory, limit: float = 1e-9) -> bool:
    return bool(max(np.abs(motion.velocity[-1]).max(), np.abs(motion.angular_velocity[-1]).max()) < limit)


def carried(motion: Trajectory, steps: int = 50) -> Array:
    """(3,): mean force of all contacts over the last steps [N]."""
    return np.asarray(motion.contact_force[-steps:].sum(axis=1).mean(axis=0))


@pytest.mark.slow
@pytest.mark.parametrize("ground", [Plane("ramp", RAMP), thorough(Terrain("ramp", lambda x, y: -np.tan(SLOPE) * x))])
def test_a_cylinder_rolls_down_a_ramp(ground: Static) -> None:
    """A = 2/3 g sin(angle), and it neither sinks nor leaves."""
    start = np.array(RAMP) * 0.1
    motion = moved(make_world([drum(position=start, orientation=ON_SIDE)], [ground], Law(0.8)), 1.0)
    way = motion.position[:, 0] - start
    exact = G * np.sin(SLOPE) / 3
    assert np.linalg.norm(way[-1]) == pytest.approx(exact, abs=1e-9 if isinstance(ground, Plane) else 2e-3)
    assert np.abs(way @ RAMP).max() < (1e-9 if isinstance(ground, Plane) else 1e-3)


RESTS = {
    "drum on its face": (drum(position=(0, 0, 0.2), orientation=turned_by((1, 2, 0), 0.2)), 0.1),
    "drum on its side": (drum(position=(0, 0, 0.2), orientation=turned_by((1, 0, 0), 1.5)), 0.1),
    "facets on their face": (stone(DRUM, position=(0, 0, 0.2), orientation=turned_by((1, 2, 0), 0.2)), 0.1),
    "facets on their side": (stone(DRUM, position=(0, 0, 0.2), orientation=turned_by((1, 0.02, 0), 1.5)), None),
    "stone": (stone(position=(0, 0, 0.5), velocity=(0.3, 0, 0)), None),
    "egg": (egg(position=(0, 0, 0.2), orientation=turned_by((1, 0, 0), 0.3)), 0.1),
}


@cache
def rest(name: str) -> Trajectory:
    """Four seconds after the drop."""
    return moved(world_of(name), 4.0)


def world_of(name: str) -> World:
    law = Law(0.6, rolling=0.05) if name == "egg" else Law(0.6)
    return make_world([RESTS[name][0]], [Plane.ground()], law)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name if name == "egg" else thorough(name) for name in RESTS])
def test_what_is_dropped_comes_to_rest_on_the_ground(name: str) -> None:
    """At its height, with its weight on it; then no corner of a hull is deeper than a millionth of its size.

    The egg would rock for ever, but for rolling friction, which also holds it a little beside its lowest place.
    """
    body, height = RESTS[name]
    motion = rest(name)
    assert is_still(motion, 1e-6)
    if height is not None:
        assert motion.position[-1, 0, 2] == pytest.approx(height, abs=1e-4 if name == "egg" else 1e-7)
    assert carried(motion) == pytest.approx([0, 0, MASS * G], abs=1e-4)
    if isinstance(hull := body.shapes[0], Convex):
        corners = np.array(hull.points)
        low = [(corners @ axes(motion, k)[2] + motion.position[k, 0, 2]).min() for k in range(len(motion.time))]
        assert min(low) > -2e-4
        assert low[-1] == pytest.approx(0, abs=1e-6)


@pytest.mark.slow
def test_a_cylinder_stands_without_wobble() -> None:
    """Put down on its face, turning: friction stops the turn, nothing tilts, and then nothing moves at all."""
    motion = moved(
        make_world([drum(position=(0, 0, 0.1), angular_velocity=(0, 0, 3))], [Plane.ground()], Law(0.6)), 2.0
    )
    assert np.abs(motion.orientation[:, 0, 1:3]).max() < 2e-6
    assert np.abs(motion.position[100:, 0] - motion.position[100, 0]).max() < 1e-10
    assert is_still(motion, 1e-12)


@pytest.mark.thorough
def test_a_cylinder_stands_on_its_rim_and_falls_to_the_lower_side() -> None:
    """Beyond the tilt at which its centre of mass is over the rim, an eighth of a turn here, it falls on its side."""
    for tilt, lies in ((np.pi / 4 - 0.1, False), (np.pi / 4 + 0.1, True)):
        high = 0.1 * (np.cos(tilt) + np.sin(tilt))
        body = drum(position=(0, 0, high), orientation=turned_by((1, 0, 0), tilt))
        motion = moved(make_world([body], [Plane.ground()], Law(0.9)), 1.2)
        assert (abs(axes(motion, -1)[2, 2]) < 0.1) == lies
        assert motion.position[-1, 0, 2] == pytest.approx(0.1, abs=1e-6)


@pytest.mark.slow
def test_an_ellipsoid_that_rocks_keeps_its_energy() -> None:
    """Rolling without slip on a plane takes and gives none: to second order of the step."""
    body = egg(position=(0, 0, 0.1089), orientation=turned_by((1, 0, 0), 0.25))
    motion = moved(make_world([body], [Plane.ground()], Law(2.0)), 3.0)
    inertia = np.diag(np.array(body.inertia))
    energies = [
        MASS * (motion.velocity[k, 0] @ motion.velocity[k, 0] / 2 + G * motion.position[k, 0, 2])
        + spin @ inertia @ spin / 2
        for k in range(len(motion.time))
        for spin in [axes(motion, k).T @ motion.angular_velocity[k, 0]]
    ]
    swing = MASS * G * (motion.position[0, 0, 2] - 0.1)
    assert abs(energies[-1] - energies[20]) < 0.05 * swing
    assert np.ptp(motion.position[-150:, 0, 2]) > 0.5 * (motion.position[0, 0, 2] - 0.1)


def test_a_spinning_egg_of_revolution_rolls_like_a_ball() -> None:
    """With three equal radii an ellipsoid is a ball: the same motion after a skid, spin and bounce."""
    start: Any = {"position": (0, 0, 0.3), "velocity": (1, 0.2, 0), "angular_velocity": (3, 9, 2)}
    law, ground = Law(0.4, 0.5), [Plane.ground()]
    bodies = Body.ellipsoid("it", (0.1,) * 3, mass=MASS, **start), Body.ball("it", 0.1, MASS, **start)
    one, other = (moved(make_world([body], ground, law), 1.5) for body in bodies)
    assert one.position == pytest.approx(other.position, abs=1e-5)
    assert one.angular_velocity == pytest.approx(other.angular_velocity, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [thorough("drum"), "egg", thorough("stone")])
def test_terrain_that_is_flat_is_a_plane(kind: str) -> None:
    """And the motion on it the same until after the first touches."""
    start: Any = {"position": (0, 0, 0.35), "orientation": turned_by((1, 2, 0), 0.7), "angular_velocity": (2, 1, 0)}
    body = {"drum": drum, "egg": egg, "stone": stone}[kind](**start)
    flat = Terrain("flat", Heightfield(((0, 0, 0), (0, 0, 0)), spacing=(4, 4), origin=(-4, -2)))
    one, other = (moved(make_world([body], [ground], Law(0.6)), 0.5) for ground in (Plane.ground(), flat))
    assert one.position[:30] == pytest.approx(other.position[:30], abs=1e-3)
    assert other.contact_gap.min() > -2e-3


@pytest.mark.parametrize(
    "under",
    [
        CylinderShape(0.3, 0.2, (0, 0, 0)),
        centred(np.array([(x, y, z) for x in (-0.3, 0.3) for y in (-0.3, 0.3) for z in (-0.2, 0.2)])),
    ],
)
def test_a_ball_rests_on_top(under: Any) -> None:
    """On the flat face of a block that is a cylinder or a hull, at its height, with its weight."""
    ball = Body.ball("it", 0.1, MASS, position=(0.05, 0.02, 0.4))
    motion = moved(make_world([ball], [Fixture("block", under)], Law(0.5, rolling=0.01)), 1.5)
    assert motion.position[-1, 0] == pytest.approx([0.05, 0.02, 0.3], abs=1e-6)
    assert carried(motion) == pytest.approx([0, 0, MASS * G], abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["drum on its face", thorough("facets on their face"), thorough("stone")])
def test_mujoco_has_them_at_the_same_height(name: str) -> None:
    """At rest after a drop, to a millimetre by which its springs give way.

    Which face the stone ends on is chance: it begins where it lies here, and must stay there.
    """
    mujoco = pytest.importorskip("mujoco")
    ours, world = rest(name), world_of(name)
    initial = Problem.from_world(world, duration=1.0).initial
    model = mujoco.MjModel.from_xml_string(mjcf(world, initial, 0.001))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    if name == "stone":
        data.qpos[:3], data.qpos[3:7] = ours.position[-1, 0], ours.orientation[-1, 0]
    mujoco.mj_step(model, data, 3000)
    assert data.qpos[2] == pytest.approx(ours.position[-1, 0, 2], abs=1e-3)
    assert np.abs(data.qvel).max() < 0.02
