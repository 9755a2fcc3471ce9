"""Worlds from Python and from tables are the same worlds; what a problem file makes of them."""

from __future__ import annotations

import doctest

import casadi as ca
import numpy as np
import pytest

import symphys
from symphys import Problem, SymphysError, step_function
from symphys.model import (
    Body,
    Box,
    Capsule,
    Fixture,
    Hinge,
    Law,
    Plane,
    Scheme,
    Servo,
    Sphere,
    Spring,
    Terrain,
    initial_state,
    make_world,
)

ROD = {"radius": 0.02, "length": 0.4}
TABLES = {
    "simulation": {"duration": 0.5, "dt": 0.01},
    "contact": {"friction": 0.4},
    "body": [
        {"name": "upper", "shape": {"capsule": ROD}, "mass": 0.5, "position": [0, 0, 0.8]},
        {"name": "lower", "shape": {"capsule": ROD}, "density": 900, "position": [0, 0, 0.4], "velocity": [0, 0.3, 0]},
    ],
    "ground": {"height": 0.1},
    "joint": [
        {"name": "shoulder", "between": ["world", "upper"], "ball": {}, "point": [0, 0, 1]},
        {
            "name": "elbow",
            "between": ["upper", "lower"],
            "hinge": {"axis": [0, 2, 0]},
            "point": [0, 0, 0.6],
            "limits": [-2, 2],
            "start": -0.4,
            "motor": {"servo": {"gain": 20, "torque": 3, "velocity": 8}},
            "spring": {"stiffness": 0.1, "damping": 0.01},
        },
    ],
    "pair": [{"between": ["lower", "ground"], "friction": 0.9}],
    "variable": [{"name": "bend", "sets": "elbow.command", "guess": [0.5]}],
}


def double_pendulum() -> symphys.model.World:
    """The same from Python."""
    bodies = [
        Body.capsule("upper", **ROD, mass=0.5, position=(0, 0, 0.8)),
        Body.capsule("lower", **ROD, density=900, position=(0, 0, 0.4), velocity=(0, 0.3, 0)),
    ]
    joints = [
        symphys.model.BallJoint("shoulder", ("world", "upper"), point=(0, 0, 1)),
        Hinge(
            "elbow",
            ("upper", "lower"),
            axis=(0, 2, 0),
            point=(0, 0, 0.6),
            limits=(-2, 2),
            start=-0.4,
            motor=Servo(gain=20, torque=3, velocity=8),
            spring=Spring(stiffness=0.1, damping=0.01),
        ),
    ]
    ground, laws = Plane.ground(0.1), {("lower", "ground"): Law(friction=0.9)}
    return make_world(bodies, [ground], Law(friction=0.4), joints=joints, laws=laws)


@pytest.mark.slow
def test_a_robot_moves_as_from_its_tables() -> None:
    """A double pendulum with a servo, bent at the start: every quantity of the motion to 1e-12."""
    made = Problem.from_world(double_pendulum(), duration=0.5, variables={"bend": TABLES["variable"][0]})
    both = [symphys.simulate(each) for each in (symphys.load(TABLES), made)]
    assert both[0]["elbow.angle"][0] == pytest.approx(-0.4, abs=1e-12)
    assert both[0]["elbow.angle"][-1] > 0.3, "the servo moves it"
    assert set(both[0].units) == set(both[1].units)
    for name in both[0].units:
        assert np.allclose(both[0][name], both[1][name], rtol=0, atol=1e-12), name


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Body", "Hinge", "make_world"])
def test_examples_run(name: str) -> None:
    runner = doctest.DocTestRunner()
    (example,) = (
        each for each in doctest.DocTestFinder(recurse=False).find(getattr(symphys.model, name), name, globs={})
    )
    assert example.examples
    assert runner.run(example).failed == 0


def test_the_step_does_not_depend_on_the_start() -> None:
    """Nor does what is kept of it: the world's numbers are the same."""
    world = make_world([Body.ball("ball", 0.1, 1.0, position=(0, 0, 3))], [Plane.ground()])
    still = make_world([Body.ball("ball", 0.1, 1.0)], [Plane.ground()])
    steps = [step_function(each, Scheme(dt=0.01)).serialize() for each in (world, still)]
    assert world == still and steps[0] == steps[1]
    assert np.array(initial_state(world))[:3].ravel().tolist() == [0, 0, 3]
    assert np.array(initial_state(world, {"ball.position": [1, 0, 0]}))[:3].ravel().tolist() == [1, 0, 0]


def test_inertia_follows_mass_and_size_as_in_a_file() -> None:
    """Where it is that of the shape; one that was given stays."""
    parts = (Sphere(0.1, (0.2, 0, 0)), Sphere(0.1, (-0.2, 0, 0)))
    bodies = [
        Body.ball("solid", 0.1, 1.0),
        Body.ball("shell", 0.1, 1.0, hollow=True, position=(1, 0, 0)),
        Body.compound("twins", parts, 1.0, position=(2, 0, 0)),
        Body("own", 1.0, 0.5, (Box((0.1, 0.1, 0.1)),), {"position": (3, 0, 0)}),
        Body("askew", 1.0, 0.5, (Capsule(0.1, 0.1, (0, 0.02, 0)),), {"position": (4, 0, 0)}),
    ]
    made = Problem.from_world(make_world(bodies), duration=0.1)
    for before, after in zip(bodies, made.world().bodies, strict=True):
        assert np.allclose(before.inertia, after.inertia, rtol=1e-13, atol=0)
    heavier = made.set({f"{body.name}.mass": 3.0 for body in bodies}).world().bodies
    for before, after in zip(bodies[:3], heavier, strict=False):
        assert np.allclose(3 * np.array(before.inertia), after.inertia, rtol=1e-13, atol=0)
    assert [body.inertia for body in heavier[3:]] == [0.5, 0.5]


def test_terrain_by_a_function_becomes_a_formula() -> None:
    def hills(x: ca.SX, y: ca.SX) -> ca.SX:
        swell = 0.1 * ca.sin(3 * x) - ca.exp(-(x**2)) / (2 + ca.cos(y))
        return swell + ca.fmax(ca.atan2(y, 2), -0.25) * ca.fabs(swell) - ca.sqrt(1 + y * y) ** 1.5

    ball = Body.ball("ball", 0.1, 1.0, position=(0, 0, 3))
    made = Problem.from_world(make_world([ball], [Terrain("hills", hills)]), duration=0.1)
    height = made.world().statics[0].height
    for x, y in np.random.default_rng(0).uniform(-2, 2, (20, 2)):
        assert float(ca.DM(height(x, y))) == pytest.approx(float(ca.DM(hills(x, y))), rel=1e-14)


def test_a_controller_is_any_casadi_function() -> None:
    """The force of a controller is what its function gives: 2 N on 0.5 kg for 0.1 s, without gravity."""
    sensed, time, weights = ca.SX.sym("sensed", 3), ca.SX.sym("time"), ca.SX.sym("weights", 1)
    world = make_world([Body.ball("ball", 0.1, 0.5)], gravity=(0, 0, 0))
    made = Problem.from_world(
        world,
        duration=0.1,
        functions={"brain": ca.Function("brain", [sensed, time, weights], [2 * weights])},
        sensor=[{"name": "where", "reads": "ball.position"}],
        controller=[
            {"name": "brain", "drives": "ball.force[0]", "senses": ["where"], "function": {"weights": [1.0]}},
        ],
    )
    assert symphys.simulate(made)["ball.velocity"][-1] == pytest.approx([0.4, 0, 0])


def test_a_block_keeps_its_place() -> None:
    """And a body that touches it; a start that is given once more is the one that counts."""
    slab = Fixture("slab", Box((1, 1, 0.1), (0, 0, -0.1)))
    ball = Body.ball("ball", 0.1, 1.0, position=(0, 0, 5), angular_velocity=(0, 0, 1))
    made = Problem.from_world(make_world([ball], [slab]), {"ball.position": [0, 0, 0.1]}, duration=0.1)
    assert made.initial["ball.position"].tolist() == [0, 0, 0.1]
    assert made.initial["ball.angular_velocity"].tolist() == [0, 0, 1]
    assert symphys.simulate(made)["ball.position"][-1][2] == pytest.approx(0.1, abs=1e-9)


def test_joints_follow_a_start_only_where_they_hold() -> None:
    with pytest.raises(SymphysError, match=r"joint 'shoulder': .*1\.2 m and 0 rad"):
        Problem.from_world(double_pendulum(), {"upper.position": [0, 0, 2]}, duration=0.5)
