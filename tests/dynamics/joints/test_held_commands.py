"""A command acts from the start of its step to the end, whatever the motor, the tree and the time step."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.laboratory import Lab, central_difference, value_and_gradient
from tools.repeats import few

from symphys.model.joints import SLIDER, AffineMotor, Joint, JointFrame, Motor, TorqueMotor, VelocityMotor
from symphys.model.shapes import Box, Plane
from symphys.model.world import Body, Law, Scheme, World, make_world

MASS = 2.0
HELD = np.array([3.0, -5.0, 1.0, 4.0])
"""[N], each for 0.1 s."""


def cart(motor: Motor, dt: float = 0.02, warm_start: bool = True) -> Lab:
    rail = Joint("rail", SLIDER, 0, None, (JointFrame(),) * 2, motor=motor)
    world = World((Body("cart", MASS, 0.1),), gravity=(0, 0, 0), joints=(rail,))
    return Lab(world, Scheme(dt=dt, warm_start=warm_start), ["rail.command"])


def driven(lab: Lab, held: Any = HELD) -> dict[str, Any]:
    steps = round(0.1 / lab.scheme.dt)
    return lab.states({}, 0.1 * len(held), u=np.repeat(held, steps)[None])


def closed_form(force: Any) -> tuple[Any, Any]:
    """(positions, velocities) at the ends of the stretches of 0.1 s."""
    v = np.cumsum(0.1 * np.asarray(force) / MASS)
    before = v - 0.1 * np.asarray(force) / MASS
    return np.cumsum(0.1 * (v + before) / 2), v


@few("dt", [0.1, 0.05, 0.025], 1)
@pytest.mark.parametrize("warm_start", [True, False])
@pytest.mark.parametrize(
    ("motor", "force"),
    [
        (TorqueMotor(4.0), np.clip(HELD, -4, 4)),
        (AffineMotor(gain=2.0, offset=-1.0, gear=-0.5, force_range=(-8.0, 6.0)), -0.5 * np.clip(2 * HELD - 1, -8, 6)),
    ],
)
def test_held_forces_move_a_mass_exactly(motor: Motor, force: Any, dt: float, warm_start: bool) -> None:
    """x = v t + F t^2 / 2 m in each stretch, at any time step."""
    states, every = driven(cart(motor, dt, warm_start)), round(0.1 / dt)
    x, v = closed_form(force)
    assert states["cart.position"][every::every, 0] == pytest.approx(x, abs=1e-14)
    assert states["cart.velocity"][every::every, 0] == pytest.approx(v, abs=1e-14)


def test_held_velocities_move_a_mass_exactly() -> None:
    for dt in (0.1, 0.025):
        states = driven(cart(VelocityMotor(1e4, 10.0), dt))
        assert states["cart.position"][-1, 0] == pytest.approx(0.1 * HELD.sum(), abs=1e-12)


def test_commands_to_a_spring_are_of_second_order() -> None:
    """A position actuator, m x'' = kp (u - x) - kv x', by held commands: places and velocities."""
    motor = AffineMotor(gain=20.0, kp=20.0, kv=3.0)
    held = np.array([0.5, -0.4, 0.3, 0.6])
    system, x = np.array([[0, 1, 0], [-20 / MASS, -3 / MASS, 20 / MASS], [0, 0, 0]]), np.zeros(3)
    values, vectors = np.linalg.eig(system.astype(complex))
    over = (vectors * np.exp(0.1 * values)) @ np.linalg.inv(vectors)
    for command in held:
        x = (over @ np.array([x[0], x[1], command])).real
    errors = []
    for n in (5, 10, 20):
        states = driven(cart(motor, 0.1 / n), held)
        errors.append([abs(states[f"cart.{name}"][-1, 0] - x[k]) for k, name in enumerate(("position", "velocity"))])
    assert np.max(errors[0]) < 2e-3
    assert np.all(np.array(errors[:-1]) > 3.5 * np.array(errors[1:]))


@pytest.mark.slow
def test_a_motor_is_a_force() -> None:
    """A box on the ground, pushed along a rail by a motor or by a force: the same motion, contacts and friction too."""
    box = Body("box", MASS, (0.02, 0.03, 0.04), (Box((0.2, 0.2, 0.1)),))
    flat = make_world([box], [Plane.ground()], Law(0.3, 0.0))
    frames = (JointFrame(), JointFrame((0, 0, 0.05)))
    ends = []
    for name, rows in (("rail.command", 1), ("box.force", 3)):
        rail = Joint("rail", SLIDER, 0, None, frames, motor=TorqueMotor(100.0))
        world = World(flat.bodies, flat.statics, flat.pairs, joints=(rail,))
        u = np.zeros((rows, 40))
        u[0] = np.repeat([20.0, -15.0, 4.0, 12.0], 10)
        ends.append(Lab(world, Scheme(dt=0.01), [name]).states({"box.position": [0, 0, 0.05]}, 0.4, u=u))
    for field in ("position", "velocity"):
        np.testing.assert_allclose(ends[0][f"box.{field}"], ends[1][f"box.{field}"], atol=1e-12)
    assert np.ptp(ends[0]["box.position"][:, 0]) > 0.1


def test_derivatives_by_commands_are_those_of_differences() -> None:
    """Also where the force reaches its bounds."""
    lab = cart(AffineMotor(gain=20.0, kp=20.0, kv=3.0, force_range=(-6.0, 7.0)))

    def end(z: Any) -> Any:
        return lab.trajectory({}, 0.4, u=ca.reshape(ca.vertcat(z), 1, -1))[:, -1]

    at = [0.5, -0.4, 0.3, 0.6] * 5
    slope = value_and_gradient(end, at)[1]
    assert slope == pytest.approx(central_difference(end, at, 1e-6), rel=1e-6, abs=1e-8)
