"""V32: hulls, cylinders and boxes stand, roll, tip, grip and collide as laws say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import symphys
from symphys import simulate
from symphys.trajectory import Trajectory
from symphys.transcription import transcribe

CAN = {"cylinder": {"radius": 0.05, "length": 0.1}}
BOARD = {"name": "board", "shape": {"box": {"size": [1, 1, 0.2]}}, "position": [0, 0, 0.1]}
LYING = {"roll_deg": 90}


def cube(half: float) -> dict[str, Any]:
    ends = (-half, half)
    return {"convex": {"points": [[x, y, z] for x in ends for y in ends for z in ends]}}


def moved(bodies: list[dict[str, Any]], duration: float, dt: float = 0.005, **tables: Any) -> Trajectory:
    first = bodies[0]["name"]
    return simulate(
        symphys.load(
            {
                "simulation": {"duration": duration, "dt": dt, "sweeps": 20},
                "contact": {"friction": 0.6},
                "body": bodies,
                "variable": [{"name": "v", "sets": f"{first}.velocity", "guess": bodies[0].get("velocity", [0, 0, 0])}],
                "cost": [{"name": "c", "value": f"{first}.position[2]"}],
                **tables,
            }
        )
    )


def body(name: str, shape: Any, place: Any, mass: float = 0.5, **more: Any) -> dict[str, Any]:
    return {"name": name, "shape": shape, "mass": mass, "position": list(place), **more}


@pytest.mark.slow
def test_a_wheel_rolls_over_the_seams_of_a_floor() -> None:
    """At its speed, level, over boards that lie flush."""
    slab = {"box": {"size": [0.2, 0.4, 0.1]}}
    floor = [{"name": f"b{k}", "shape": slab, "position": [0.2 * k, 0, -0.05]} for k in range(3)]
    wheel = body("wheel", CAN, (0, 0, 0.05), velocity=[0.5, 0, 0], angular_velocity=[0, 10, 0], orientation=LYING)
    motion = moved([wheel], 0.6, 0.01, block=floor)
    np.testing.assert_allclose(motion.velocity[:, 0, 0], 0.5, atol=1e-12)
    np.testing.assert_allclose(motion.position[:, 0, 2], 0.05, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("beyond", [-0.005, pytest.param(0.005, marks=pytest.mark.thorough)])
def test_a_can_falls_from_a_table_where_its_middle_is_beyond_the_edge(beyond: float) -> None:
    motion = moved([body("can", CAN, (0.5 + beyond, 0, 0.2501))], 0.4, block=[BOARD])
    falls = motion.position[-1, 0, 2] < 0.24
    assert falls == (beyond > 0)
    if not falls:
        np.testing.assert_allclose(motion.position[-1, 0], [0.5 + beyond, 0, 0.25], atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("held", [CAN, pytest.param(cube(0.05), marks=pytest.mark.thorough)], ids=["can", "hull"])
@pytest.mark.parametrize("force", [3.0, pytest.param(1.5, marks=pytest.mark.thorough)])
def test_fingers_of_points_hold_what_coulomb_lets_them(held: Any, force: float) -> None:
    """Two fingers press with 3 N each: 2 mu N is 3.6 N, and a weight of 1.96 N stays; with 1.5 N it slides down."""
    tip = {"convex": {"points": [[x, y, z] for x in (-0.01, 0.01) for y in (-0.015, 0.015) for z in (-0.02, 0.02)]}}
    bodies = [
        body("held", held, (0, 0, 0.5), 0.2),
        *(body(name, tip, (side * 0.0601, 0, 0.5), 0.2, inertia=1e-4) for name, side in (("l", -1), ("r", 1))),
    ]
    joints = [
        {
            "name": f"slide_{name}",
            "between": ["world", name],
            "slider": {"axis": [axis, 0, 0]},
            "motor": {"affine": {}},
        }
        for name, axis in (("l", 1), ("r", -1))
    ]
    press = [{"name": "press", "sets": ["slide_l.command", "slide_r.command"], "guess": force}]
    motion = moved(bodies, 0.5, joint=joints, variable=press)
    slid = motion.velocity[-1, 0, 2]
    if force == 3.0:
        assert abs(slid) < 1e-9 and motion.position[-1, 0, 2] > 0.499
    else:
        pulled = -9.81 + 2 * 0.6 * force / 0.2
        assert slid == pytest.approx(pulled * 0.5, rel=0.03)


@pytest.mark.thorough
def test_cans_stand_on_each_other_and_a_coin_on_its_edge() -> None:
    stack = [body(f"can{k}", CAN, (0.002 * k, 0, 0.05 + 0.1 * k)) for k in range(3)]
    motion = moved(stack, 0.6, ground={})
    wanted = [[0.002 * k, 0, 0.05 + 0.1 * k] for k in range(3)]
    np.testing.assert_allclose(motion.position[-1], wanted, atol=1e-12)
    coin = {"cylinder": {"radius": 0.05, "length": 0.01}}
    rolls = body("coin", coin, (-0.2, 0, 0.25), velocity=[0.5, 0, 0], angular_velocity=[0, 10, 0], orientation=LYING)
    motion = moved([rolls], 0.5, block=[BOARD])
    np.testing.assert_allclose(motion.position[-1, 0], [0.05, 0, 0.25], atol=1e-12)


@pytest.mark.thorough
@pytest.mark.parametrize("shape", [CAN, cube(0.05)], ids=["can", "hull"])
def test_what_lies_in_a_v_stays(shape: Any) -> None:
    sides = [
        {
            "name": name,
            "shape": {"box": {"size": [0.4, 0.4, 0.1]}},
            "position": [0.2 * side, 0, 0.3],
            "orientation": {"pitch_deg": -45 * side},
        }
        for name, side in (("l", -1), ("r", 1))
    ]
    turned = {"pitch_deg": 45} if "convex" in shape else LYING
    motion = moved([body("it", shape, (0, 0, 0.42), orientation=turned)], 0.6, block=sides)
    lowest = 0.3 - 0.2 + 2 * 0.05 * np.sqrt(2)
    assert motion.position[-1, 0] == pytest.approx([0, 0, lowest], abs=1e-9)
    assert np.abs(motion.velocity[-1]).max() < 1e-12


PAIRS = {
    "hull-can": (cube(0.05), CAN),
    "can-can": (CAN, CAN),
    "box-can": ({"box": {"size": [0.1, 0.08, 0.12]}}, CAN),
    "hull-hull": (cube(0.05), cube(0.04)),
    "capsule-hull": ({"capsule": {"radius": 0.03, "length": 0.1}}, cube(0.05)),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    "pair", ["hull-can", *(pytest.param(name, marks=pytest.mark.thorough) for name in PAIRS if name != "hull-can")]
)
def test_an_elastic_impact_keeps_momentum_and_energy(pair: str) -> None:
    """Without friction; both turn."""
    one, other = PAIRS[pair]
    bodies = [
        body("a", one, (-0.2, 0.01, 0.02), 1.0, velocity=[1, 0, 0], angular_velocity=[2, -3, 1], inertia=[2e-3] * 3),
        body("b", other, (0.1, 0, 0), 2.0, angular_velocity=[1, 1, 2], inertia=[3e-3] * 3, orientation={"yaw_deg": 30}),
    ]
    contact = {"friction": 0, "restitution": 1}
    motion = moved(bodies, 0.4, contact=contact, world={"gravity": [0, 0, 0]})
    momentum = motion.velocity[:, 0] + 2 * motion.velocity[:, 1]
    np.testing.assert_allclose(momentum, np.tile(momentum[0], (len(momentum), 1)), atol=1e-12)
    turning = 1e-3 * (2 * (motion.angular_velocity[:, 0] ** 2).sum(1) + 3 * (motion.angular_velocity[:, 1] ** 2).sum(1))
    energy = (motion.velocity[:, 0] ** 2).sum(1) + 2 * (motion.velocity[:, 1] ** 2).sum(1) + turning
    assert np.abs(motion.contact_force).max() > 0
    assert energy[-1] == pytest.approx(energy[0], rel=1e-5)
    assert np.diff(energy).max() < 1e-5 * energy[0]


@pytest.mark.thorough
def test_a_cube_of_points_tumbles_as_a_box() -> None:
    """To the same place, in the limit of small steps."""
    start = {"orientation": {"roll_deg": 20, "pitch_deg": 35}, "angular_velocity": [1, 2, 3], "velocity": [0.3, 0.2, 0]}
    ends = []
    for shape, dt in ((cube(0.1), 0.005), (cube(0.1), 0.00125), ({"box": {"size": [0.2] * 3}}, 0.00125)):
        ends.append(moved([body("it", shape, (0, 0, 0.5), **start)], 0.6, dt, block=[BOARD]).position[-1, 0])
    assert np.abs(ends[1] - ends[2]).max() < 1e-4
    assert np.abs(ends[0] - ends[1]).max() < 2e-3


def test_hulls_of_many_corners_are_refused_beside_solids() -> None:
    """On the ground and beside balls they may have many."""
    points = np.random.default_rng(0).normal(size=(300, 3))
    points /= 10 * np.linalg.norm(points, axis=1)[:, None]
    rock = body("rock", {"convex": {"points": points.tolist()}}, (0, 0, 1), inertia=0.01)
    other = body("crate", {"box": {"size": [0.1, 0.1, 0.1]}}, (1, 0, 1))
    rest = {
        "simulation": {"duration": 0.1, "dt": 0.01},
        "ground": {},
        "variable": [{"name": "v", "sets": "rock.velocity"}],
        "cost": [{"name": "c", "value": "rock.position[2]"}],
    }
    with pytest.raises(symphys.ProblemError, match="rock has a hull of 300 corners, and touches crate, a box"):
        symphys.load({"body": [rock, other], **rest})
    ball = body("ball", {"sphere": {"radius": 0.1}}, (1, 0, 1))
    assert symphys.load({"body": [rock, ball], **rest}).world().pairs


@pytest.mark.slow
@pytest.mark.parametrize("shape", [pytest.param(CAN, marks=pytest.mark.thorough), cube(0.05)], ids=["can", "hull"])
def test_gradients_through_their_impacts_are_those_of_differences(shape: Any) -> None:
    """A bounce with friction on a corner or on a rim."""
    spun = {"orientation": {"roll_deg": 25, "pitch_deg": 35}, "angular_velocity": [3, 1, 2]}
    problem = symphys.load(
        {
            "simulation": {"duration": 0.25, "dt": 0.01},
            "contact": {"friction": 0.4, "restitution": 0.4},
            "block": [BOARD],
            "body": [body("it", shape, (0, 0, 0.32), **spun)],
            "variable": [{"name": "v", "sets": "it.velocity", "guess": [0.5, 0.2, -1]}],
            "cost": [{"name": "c", "value": "sumsqr(it.position - [0.3, 0.1, 0.4]) + 0.1 * sumsqr(it.velocity)"}],
        }
    )
    made = transcribe(problem, backend="casadi")
    evaluator, z, h = made.shooting.evaluator, made.shooting.start(0), 1e-6
    slope = evaluator.gradient(z[None], 0.0).gradient
    assert slope is not None and np.abs(made.simulate(z).contact_force).max() > 0
    ahead, behind = (evaluator.value(z + sign * h * np.eye(3), 0.0).merit for sign in (1, -1))
    np.testing.assert_allclose((ahead - behind) / (2 * h), slope[0], rtol=1e-5, atol=1e-7)
