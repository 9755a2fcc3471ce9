"""The studies of robots on a tiny size: states are consistent, errors fall with the step, times are taken."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from robots import JointedScene, Pose, Rotation, chain, quadruped, standing, state_of, swinging

from symphys.codegen import KernelUnavailable
from symphys.codegen.toolchain.compiler import find_compiler
from symphys.dynamics.observation.joint_coordinates import readings
from symphys.model.joints import Spring
from symphys.model.state_layout import initial_state


@pytest.fixture
def compiled() -> None:
    pytest.importorskip("mujoco")
    try:
        find_compiler()
    except KernelUnavailable as error:
        pytest.skip(str(error))


def test_states_have_the_coordinates_and_rates_that_were_asked_for() -> None:
    rng, world = np.random.default_rng(0), quadruped()
    angles, rates = ({joint.name: rng.normal(0, 0.5) for joint in world.joints} for _ in range(2))
    root = Pose(Rotation.from_rotvec([0.1, 0.2, 0.3]), *rng.normal(0, 1, (3, 3)))
    x = ca.SX(ca.DM(initial_state(world, state_of(world, angles, rates, root))))
    for name, reading in readings(world, x).items():
        assert float(reading.value) == pytest.approx(angles[name], abs=1e-12)
        assert float(reading.rate) == pytest.approx(rates[name], abs=1e-12)
        assert float(reading.separation) < 1e-12 > float(reading.tilt)


def test_a_quadruped_stands_on_its_feet() -> None:
    scene = standing(batch=1)
    heights = [scene.start[0][f"{body.name}.position"][2] for body in scene.robot.bodies if body.shapes]
    assert np.array(heights) - 0.15 == pytest.approx(0.05)
    assert len(scene.robot.pairs) == 4


@pytest.mark.slow
@pytest.mark.usefixtures("compiled")
def test_engines_agree_without_contact() -> None:
    from consistency import differences, flung

    errors = np.median(differences(flung("chain", chain(2, spring=Spring(0.5, 0.01)), 1.0, 2), (0.01, 0.005)), axis=1)
    assert 3 < errors[0] / errors[1] < 5
    assert errors[1] < 1e-3


@pytest.mark.slow
@pytest.mark.usefixtures("compiled")
def test_errors_against_oneself_fall_with_the_step() -> None:
    from consistency import engines, errors_of

    for engine in engines(swinging(2, 2), "Euler", "RK4"):
        errors = errors_of(engine, 0.16, (0.02, 0.01), 0.00125, 0.08)
        assert errors.shape == (2, 2)
        assert (errors[1] > 0).all() and (errors[1] < errors[0]).all()


@pytest.mark.slow
@pytest.mark.usefixtures("compiled")
def test_steps_and_derivatives_are_timed() -> None:
    from speed import compared, here, there

    scene: JointedScene = swinging(2, 8)
    ours, theirs = compared("chain", [here(scene, 5, 8, steps=5), there(scene, "Euler", "elliptic", steps=5)], 2)
    assert theirs["engine"] == "MuJoCo, Euler, elliptic"
    assert theirs["times_steps"] == theirs["times_derivatives"] == 1
    assert min(ours["times_steps"], ours["thousand_derivatives_s"]) > 0
