"""What rolls, slides and stands on ground that moves itself: turntables, planks, sleds and wedges."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from data.textbook import G, differences, final
from tools.laboratory import Lab
from tools.repeats import first
from worlds.blocks import among, block, turned_by
from worlds.linkage import ABOUT_Z

from symphys.model.joints import HINGE, SLIDER, Joint, JointFrame
from symphys.model.shapes import Box
from symphys.model.world import Body, Law, Scheme, World, make_world
from symphys.types import Array

R = 0.05


def turntable(dt: float, mu: float = 0.5) -> Lab:
    """A ball on a heavy plate that turns freely about z; its top at z = 0."""
    plate = Body("plate", 1e3, (1e3, 1e3, 1e3), (Box((2.0, 2.0, 0.1)),))
    world = make_world([plate, Body.ball("b", R, 0.1)], [], Law(mu))
    axle = Joint("axle", HINGE, 0, None, (JointFrame((0, 0, 0), ABOUT_Z), JointFrame((0, 0, -0.1), ABOUT_Z)))
    return Lab(World(world.bodies, pairs=world.pairs, joints=(axle,)), Scheme(dt=dt))


@pytest.mark.slow
@first("dt", [0.01, 0.005])
def test_ball_circles_on_a_turntable(dt: float) -> None:
    """Weltner 1979: rolling on a plate that turns at W a ball moves on circles at 2/7 W, whatever its velocity.

    v - W0 = 2/7 W z x (p - p0) with p0, W0 the values at the start, so dv/dt = 2/7 W z x v exactly.
    """
    spin, time = 3.0, 1.0
    lab = turntable(dt)

    def start(z: Any) -> dict[str, Any]:
        """At (0.3, 0), rolling there without slip: v + w x (-r z) = W z x p."""
        u = ca.vertcat(z[0], z[1] - spin * 0.3)
        return {
            "plate.position": [0, 0, -0.1],
            "plate.angular_velocity": [0, 0, spin],
            "b.position": [0.3, 0, R],
            "b.velocity": ca.vertcat(z[0], z[1], 0),
            "b.angular_velocity": ca.vertcat(-u[1] / R, u[0] / R, 0),
        }

    def exact(z: Array) -> Array:
        k = 2 / 7 * spin
        v, turned = complex(z[0], z[1]), np.exp(1j * k * time)
        p, v = 0.3 + v * (turned - 1) / (1j * k), v * turned
        return np.array([p.real, p.imag, v.real, v.imag])

    at = [0.2, 0.5]
    value, slope = final(lab, start, time, ["b.position", "b.velocity"], at)
    assert value[[0, 1, 3, 4]] == pytest.approx(exact(np.array(at)), abs=5e-6)
    assert slope[[0, 1, 3, 4]] == pytest.approx(differences(exact, at), abs=2e-5)


@pytest.mark.slow
@first("dt", [0.01, 0.0025])
def test_ball_on_a_plank_that_slides(dt: float) -> None:
    """A plank M moves at V on ice, a ball m is put on it: momentum is kept, and it rolls from t1 on.

    Slip u = V0 - v - r w falls at mu g (1 + m/M + 5/2), so t1 = V0 / (mu g (7/2 + m/M)); then v = mu g t1.
    """
    mass, plank, mu, time = 1.0, 2.0, 0.3, 0.8
    m = ca.SX.sym("m")
    bodies = [block("plank", (2.0, 0.5, 0.1), plank), Body.ball("b", R, m)]
    world = make_world(bodies, [], Law(mu))
    frames = JointFrame(), JointFrame((0, 0, -0.1))
    rail = Joint("rail", SLIDER, 0, None, frames)
    lab = Lab(World(world.bodies, pairs=world.pairs, joints=(rail,)), Scheme(dt=dt), parameters=[m])

    def start(z: Any) -> dict[str, Any]:
        return {
            "plank.position": [0, 0, -0.1],
            "plank.velocity": ca.vertcat(z[0], 0, 0),
            "b.position": [0, 0, R],
        }

    def exact(z: Array) -> Array:
        t1 = z[0] / (mu * G * (3.5 + z[1] / plank))
        v, push = mu * G * t1, mu * G * z[1] / plank * t1
        x = mu * G * t1**2 / 2 + v * (time - t1)
        return np.array([x, v, -2.5 * v / R, z[0] * t1 - push * t1 / 2 + (z[0] - push) * (time - t1), z[0] - push])

    at = [2.0, mass]
    names = ["b.position", "b.velocity", "b.angular_velocity", "plank.position", "plank.velocity"]
    value, slope = final(lab, start, time, names, at, lambda z: z[1])
    mine = [0, 3, 7, 9, 12]
    # rolling begins at the boundary of a step
    assert value[mine] == pytest.approx(exact(np.array(at)), abs=mu * G * dt**2 / 8)
    assert slope[mine] == pytest.approx(differences(exact, at), abs=1e-4)


def sled(alpha: float, mu: float, mass: float) -> World:
    """A sled on a rail along x, its top a slope that falls to +x; a block of 1 kg on it, at rest in the middle."""
    top = Box((0.6, 0.3, 0.1), orientation=tuple(turned_by((0, 1, 0), alpha)))
    bodies = [Body("sled", mass, 0.1 * mass, (top,)), block("b", (0.1, 0.1, 0.05))]
    world = among(make_world(bodies, [], Law(mu)), {(0, 1)})
    return replace(world, joints=(Joint("rail", SLIDER, 0, None, (JointFrame(), JointFrame())),))


@pytest.mark.slow
@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("share", [0.97, 1.03])
def test_block_on_an_accelerated_slope(share: float, side: int) -> None:
    """It stays iff g tan(alpha - phi) < a < g tan(alpha + phi), tan(phi) = mu; the slope falls against the push."""
    alpha, mu, mass = 0.4, 0.3, 4.0
    phi = np.arctan(mu)
    lab = Lab(sled(alpha, mu, mass), Scheme(cuts=0), ["sled.force"])
    # inside the range for a share below 1, at either end
    low, high = G * np.tan(alpha - phi), G * np.tan(alpha + phi)
    a = (high + low) / 2 + side * share * (high - low) / 2
    normal = np.array([np.sin(alpha), 0, np.cos(alpha)])
    start = {"b.position": 0.15 * normal, "b.orientation": turned_by((0, 1, 0), alpha)}
    time = 0.4
    force = np.tile([[a * (mass + 1)], [0], [0]], round(time / 0.01))
    states = lab.states(start, time, u=force)
    relative = states["b.velocity"][:, 0] - states["sled.velocity"][:, 0]
    if share < 1:
        # the first steps find the forces
        assert np.abs(relative).max() < 2e-3
        assert np.abs(relative[-10:]).max() < 1e-9
        assert states["sled.velocity"][-1, 0] == pytest.approx(a * time, abs=1e-6)
    else:
        # along the slope g (sin - mu' cos) - A (cos + mu' sin), mu' = -side mu; A from (M, m) along x
        rough = -side * mu
        c, s = np.cos(alpha), np.sin(alpha)
        matrix = [[mass + 1, c], [c + rough * s, 1]]
        whole, along = np.linalg.solve(matrix, [force[0, 0], G * (s - rough * c)])
        assert states["sled.velocity"][-1, 0] == pytest.approx(whole * time, abs=1e-3)
        assert relative[-1] - relative[10] == pytest.approx(along * c * (time - 0.1), rel=0.01)


@pytest.mark.slow
@first("dt", [0.01, 0.005])
def test_block_slides_down_a_wedge_that_gives_way(dt: float) -> None:
    """Frictionless: the wedge goes back at m g sin cos / (M + m sin^2), momentum along x is kept; by M too."""
    alpha, mass, time = 0.4, 3.0, 0.3
    m = ca.SX.sym("M")
    lab = Lab(sled(alpha, 0.0, m), Scheme(dt=dt, cuts=0), parameters=[m])
    normal = np.array([np.sin(alpha), 0, np.cos(alpha)])
    start = {"b.position": 0.15 * normal, "b.orientation": turned_by((0, 1, 0), alpha)}

    def exact(z: Array) -> Array:
        a = G * np.sin(alpha) * np.cos(alpha) / (z[0] + np.sin(alpha) ** 2)
        down = (1 + z[0]) * a * np.tan(alpha)
        return np.array([z[0] * a, -down, -a]) * time

    value, slope = final(lab, lambda z: start, time, ["b.velocity", "sled.velocity"], [mass], lambda z: z)
    assert value[[0, 2, 3]] == pytest.approx(exact(np.array([mass])), abs=1e-7)
    assert slope[[0, 2, 3]] == pytest.approx(differences(exact, [mass]), abs=1e-6)
