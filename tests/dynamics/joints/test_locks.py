"""What joints lock stays locked, what they leave is free, and nothing is made of nothing."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tools.laboratory import Lab
from tools.repeats import few
from worlds.linkage import ABOUT_Y, chain, energy, hanging, momenta, rod, separations

from symphys.model.joints import KINDS, Joint, JointFrame, Servo
from symphys.model.world import Body, Scheme, World
from symphys.types import Array

G = 9.81
DOF = {"ball": 3, "fixed": 0, "hinge": 1, "slider": 1, "universal": 2}


def pair_of_bodies(kind: str, **more: Any) -> World:
    """Two bodies without gravity, joined off their centres, along skew axes."""
    bodies = (Body("a", 1.0, (0.02, 0.03, 0.04)), Body("b", 2.0, (0.05, 0.04, 0.06)))
    frames = JointFrame((0.1, 0.2, 0.05), ABOUT_Y), JointFrame((-0.1, 0.05, -0.2), ABOUT_Y)
    return World(bodies, gravity=(0, 0, 0), joints=(Joint("j", KINDS[kind], 0, 1, frames, **more),))


def thrown(world: World) -> dict[str, Any]:
    """Both aligned, their frames together, tumbling as one rigid body would."""
    first, second = (np.array(frame.point) for frame in world.joints[0].frames)
    place, spin = second - first, np.array([1.0, -2.0, 1.5])
    values = {"a.position": place, "a.velocity": np.cross(spin, place) + 1, "a.angular_velocity": spin}
    return values | {"b.velocity": [1, 1, 1], "b.angular_velocity": spin}


@cache
def tumbling(kind: str, dt: float = 0.01) -> tuple[World, dict[str, Array]]:
    world = pair_of_bodies(kind)
    return world, Lab(world, Scheme(dt=dt)).states(thrown(world), 2.0)


def relative(states: dict[str, Array]) -> Rotation:
    a, b = (Rotation.from_quat(states[f"{name}.orientation"], scalar_first=True) for name in "ab")
    return b.inv() * a


@few("kind", KINDS, 2)
def test_what_is_locked_stays_locked(kind: str) -> None:
    world, states = tumbling(kind)
    if kind != "slider":
        assert separations(world, states).max() < 1e-5
    turn = relative(states)
    about_x, others = turn.as_rotvec()[:, 1], np.delete(turn.as_rotvec(), 1, axis=1)
    if kind in ("fixed", "slider"):
        assert np.abs(turn.as_rotvec()).max() < 1e-4
    if kind == "hinge":
        assert np.abs(others).max() < 1e-4 < 0.5 < np.abs(about_x).max()
    if kind == "universal":
        across = turn.apply([0, 1, 0]) @ np.array([-1, 0, 0])  # x of one frame against y of the other
        assert np.abs(across).max() < 1e-4 < 0.5 < np.abs(others).max()


@pytest.mark.parametrize("kind", KINDS)
def test_v7_momenta_are_kept(kind: str) -> None:
    """Whatever the solver leaves; angular momentum as well, since impulses act on one point."""
    world, states = tumbling(kind)
    linear, angular = momenta(world, states)
    assert np.abs(linear - linear[0]).max() < 1e-12
    assert np.abs(angular - angular[0]).max() < 1e-6


@few("kind", KINDS, 2)
def test_energy_is_kept_to_second_order(kind: str) -> None:
    drifts = []
    for dt in (0.01, 0.005):
        world, states = tumbling(kind, dt)
        kept = energy(world, states, 0.0)
        drifts.append(np.abs(kept - kept[0]).max() / kept[0])
    assert drifts[0] < 5e-3
    assert drifts[1] < drifts[0] / 3


def test_v8_pendulum_keeps_its_energy() -> None:
    """25 s from horizontal, undamped, h = .01: below a hundredth of m g l (Dojo)."""
    world = chain(1)
    states = Lab(world, Scheme()).states(hanging(1, [np.pi / 2]), 25.0)
    kept = energy(world, states)
    assert np.abs(kept - kept[0]).max() < 1e-2 * G * 0.5
    assert separations(world, states).max() < 1e-5


def test_pendulum_swings_in_its_time() -> None:
    """T = 2 pi sqrt(2 l / 3 g) of a rod, small angles."""
    x = Lab(chain(1), Scheme()).states(hanging(1, [0.02]), 10.0)["b0.position"][:, 0]
    up = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))
    crossings = 0.01 * (up - x[up] / (x[up + 1] - x[up]))
    assert np.diff(crossings) == pytest.approx(2 * np.pi * np.sqrt(2 * 0.5 / (3 * G)), rel=1e-3)


@few(("sweeps", "dt"), [(4, 0.01), (10, 0.01), (10, 0.0025), (100, 0.01)], 1)
def test_chains_of_four_hold_whatever_the_sweeps(sweeps: int, dt: float) -> None:
    """They whip; warm start must not feed errors back."""
    world = chain(4)
    states = Lab(world, Scheme(dt=dt, sweeps=sweeps)).states(hanging(4, [np.pi / 2] * 4), 4.0)
    assert separations(world, states).max() < 0.03
    kept = energy(world, states)
    assert kept.max() - kept[0] < 3.0


def test_v7_a_motorised_robot_in_flight_keeps_its_momenta() -> None:
    world = chain(4, free=True, motor=Servo(20.0, 2.0, 5.0))
    lab = Lab(
        World(world.bodies, gravity=(0, 0, 0), joints=world.joints), Scheme(), [f"j{k}.command" for k in (1, 2, 3)]
    )
    commands = 0.8 * np.sin(2 * np.pi * np.arange(500) * 0.01 + np.arange(3)[:, None])
    states = lab.states(hanging(4, [0.0] * 4) | {f"b{k}.velocity": [0.3, 0.2, 0.1] for k in range(4)}, 5.0, u=commands)
    linear, angular = momenta(world, states)
    assert np.abs(linear - linear[0]).max() < 1e-11
    assert np.abs(angular - angular[0]).max() < 1e-6
    assert np.abs(states["b0.angular_velocity"]).max() > 0.5


@pytest.mark.slow
def test_v7_a_ball_hits_a_floating_linkage() -> None:
    """10 kg at 5 m/s: the momentum of all is 50 N s, in whatever way the impact is taken apart."""
    from symphys.model.shapes import Capsule
    from symphys.model.world import Law, make_world

    rods = [Body(f"b{k}", 1.0, (0.02, 0.02, 1e-3), (Capsule(0.05, 0.2),)) for k in range(2)]
    world = make_world([*rods, Body.ball("ball", 0.1, 10.0)], [], Law(0.3, 0.5), (0, 0, 0))
    hinge = chain(2, free=True).joints
    pairs = tuple(pair for pair in world.pairs if pair.second.body == 2)
    world = World(world.bodies, pairs=pairs, gravity=(0, 0, 0), joints=hinge)
    start = hanging(2, [0.0, 0.0]) | {"ball.position": [-0.5, 0, -0.6], "ball.velocity": [5.0, 0, 0]}
    for cuts in (0, 1, 2):
        states = Lab(world, Scheme(cuts=cuts)).states(start, 0.5)
        total = sum(body.mass * states[f"{body.name}.velocity"] for body in world.bodies)
        assert total == pytest.approx(np.tile([50.0, 0, 0], (51, 1)), abs=1e-9)
        assert states["ball.velocity"][-1, 0] < 4.9
        assert separations(world, states).max() < (1e-4 if cuts else 0.02)


def parallelogram(angle: float) -> tuple[World, dict[str, Any]]:
    """A closed loop, and its start: two rods on the world, at this angle, carry a third, which must not turn."""
    bodies = (rod("b0"), rod("b1"), rod("bar", 1.0))
    down, up = JointFrame((0, 0, -0.25), ABOUT_Y), JointFrame((0, 0, 0.25), ABOUT_Y)
    lying = (np.sqrt(0.5), 0, np.sqrt(0.5), 0)  # the bar's z along x
    back = Rotation.from_quat(lying, scalar_first=True).inv() * Rotation.from_quat(ABOUT_Y, scalar_first=True)
    ends = [JointFrame((0, 0, z), tuple(back.as_quat(scalar_first=True))) for z in (-0.5, 0.5)]
    joints = [Joint(f"top{k}", KINDS["hinge"], k, None, (up, JointFrame((k, 0, 0), ABOUT_Y))) for k in range(2)]
    joints += [Joint(f"low{k}", KINDS["hinge"], 2, k, (ends[k], down)) for k in range(2)]
    start = hanging(1, [angle]) | {"bar.orientation": lying}
    start |= {"b1.position": start["b0.position"] + [1, 0, 0], "b1.orientation": start["b0.orientation"]}
    start["bar.position"] = 2 * start["b0.position"] + [0.5, 0, 0]
    return World(bodies, joints=tuple(joints)), start


def test_a_parallelogram_stays_one() -> None:
    world, start = parallelogram(0.6)
    states = Lab(world, Scheme(sweeps=20)).states(start, 3.0)
    assert separations(world, states).max() < 1e-4
    bar = Rotation.from_quat(states["bar.orientation"], scalar_first=True).apply([0, 0, 1])
    assert np.abs(bar - [1, 0, 0]).max() < 1e-3
    kept = energy(world, states)
    assert np.abs(kept - kept[0]).max() < 0.02 * abs(kept[0])


def test_the_position_pass_holds_a_loop_together() -> None:
    world, start = parallelogram(1.2)
    without, two = (
        separations(world, Lab(world, Scheme(position_sweeps=count)).states(start, 0.5)).max() for count in (0, 2)
    )
    assert two < 0.3 * without


def test_trees_need_no_sweeps() -> None:
    """They are solved exactly before them: one sweep gives what ten do."""
    world, start = chain(2), hanging(2, [1.0, 1.0])
    one, ten = (Lab(world, Scheme(sweeps=count)).states(start, 0.6) for count in (1, 10))
    for name, values in one.items():
        assert values == pytest.approx(ten[name], abs=1e-12), name
    assert np.abs(one["b1.angular_velocity"]).max() > 1
