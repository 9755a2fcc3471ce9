"""V13: jointed robots move as MuJoCo moves them, without contact: the difference falls as the square of the step."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from robots import REST, chain, quadruped, state_of
from tools.laboratory import Lab
from worlds.mixed import mixed

from symphys.export import mjcf
from symphys.model.joints import Spring, TorqueMotor
from symphys.model.world import Scheme, World

mujoco = pytest.importorskip("mujoco")
FINE = 2e-4
"""[s], at which MuJoCo's Runge-Kutta steps are exact to 1e-9 m here."""


def exact(world: World, start: dict[str, Any], torque: float, time: float) -> np.ndarray:
    """(bodies, 3): where MuJoCo has the bodies in the end."""
    text = mjcf(world, start, FINE).replace("implicitfast", "RK4")
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    data.ctrl[:] = torque
    mujoco.mj_step(model, data, round(time / FINE))
    mujoco.mj_kinematics(model, data)
    return np.array([data.xipos[model.body(body.name).id] for body in world.bodies])


def difference(world: World, start: dict[str, Any], torque: float, time: float, dt: float) -> float:
    """[m], root mean square over bodies."""
    commands = [f"{joint.name}.command" for joint in world.joints if joint.driven]
    lab = Lab(world, Scheme(dt=dt, sweeps=30), commands)
    u = np.full((len(commands), round(time / dt)), torque)
    states = lab.states(start, time, u=u)
    ours = np.array([states[f"{body.name}.position"][-1] for body in world.bodies])
    return float(np.sqrt(((ours - exact(world, start, torque, time)) ** 2).sum(axis=1).mean()))


def falls_as_a_square(world: World, start: dict[str, Any], torque: float, time: float, largest: float) -> None:
    errors = [difference(world, start, torque, time, dt) for dt in (0.005, 0.0025)]
    assert errors[1] < largest
    assert errors[0] == pytest.approx(4 * errors[1], rel=0.15)


@pytest.mark.slow
def test_chain_with_springs_dampers_and_motors() -> None:
    rng, world = np.random.default_rng(2), chain(4, spring=Spring(2.0, 0.05, 0.3), motor=TorqueMotor(0.5))
    angles, rates = ({joint.name: rng.normal(0, 0.5) for joint in world.joints} for _ in range(2))
    falls_as_a_square(world, state_of(world, angles, rates), 0.1, 1.0, 1e-4)


@pytest.mark.slow
def test_every_kind_of_joint() -> None:
    falls_as_a_square(*mixed(), torque=0.5, time=0.3, largest=1e-5)


@pytest.mark.thorough
def test_quadruped_in_flight() -> None:
    rng, world = np.random.default_rng(2), quadruped(TorqueMotor(5.0), Spring(5.0, 0.1), ground=False)
    rates = {joint.name: rng.normal() for joint in world.joints}
    falls_as_a_square(world, state_of(world, {}, rates, REST), 0.3, 1.0, 1e-4)
