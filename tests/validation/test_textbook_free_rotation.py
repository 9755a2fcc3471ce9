"""Bodies that turn freely: Euler's equations, flips about the middle axis, wheels, plates and rods that turn fast."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from data.textbook import about_a_point, differences, final, turn
from scipy.spatial.transform import Rotation
from scipy.special import ellipk
from tools.laboratory import Lab
from tools.repeats import few
from worlds.linkage import momenta

from symphys.maths import rotation
from symphys.model.world import Body, Scheme, World
from symphys.types import Array

MOMENTS = (1.0, 2.0, 3.0)
BODIES = {
    "brick": (0.0130, 0.0100, 0.0033),
    "coin": (1e-3, 1e-3, 2e-3),
    "plate": (1.0e-3, 3.0e-3, 4.0e-3),
    "rod": (0.03, 0.03, 1e-4),
    "needle": (0.03, 0.03, 1e-7),
}
"""Principal moments [kg m^2]: a book, a thin disc, a thin plate, a rod of 60 x 3 cm, a wire."""


@cache
def free(moments: tuple[float, ...], dt: float) -> Lab:
    return Lab(World((Body("b", 1.0, moments),), gravity=(0, 0, 0)), Scheme(dt=dt))


def energy(moments: tuple[float, ...], states: dict[str, Array]) -> Array:
    """(N,) [J] of the turning."""
    inside = np.array(
        [turn(q).T @ w for q, w in zip(states["b.orientation"], states["b.angular_velocity"], strict=True)]
    )
    return np.asarray((inside**2 @ np.array(moments)) / 2)


def test_flips_about_the_middle_axis_take_their_time() -> None:
    """Landau, Lifshitz 37: T = 4 K(m) sqrt(A B C / ((C - B)(L^2 - 2 E A))), half of it from flip to flip."""
    a, b, c = MOMENTS
    w = np.array([0.1, 2.0, 0.0])
    twice, square = (MOMENTS * w**2).sum(), ((np.array(MOMENTS) * w) ** 2).sum()
    # L^2 < 2 E B here: the axes change their places
    assert square < twice * b
    a, c = c, a
    m = (b - a) * (twice * c - square) / ((c - b) * (square - twice * a))
    half = 2 * ellipk(m) * np.sqrt(a * b * c / ((c - b) * (square - twice * a)))
    found = []
    for dt in (0.01, 0.005):
        states = free(MOMENTS, dt).states({"b.angular_velocity": w}, 12.0)
        about = np.array(
            [turn(q)[:, 1] @ v for q, v in zip(states["b.orientation"], states["b.angular_velocity"], strict=True)]
        )
        flips = np.flatnonzero(about[:-1] * about[1:] < 0)
        found.append(np.diff(dt * (flips + about[flips] / (about[flips] - about[flips + 1]))))
    assert found[0] == pytest.approx([half], abs=2e-3)
    assert found[1] == pytest.approx([half], abs=5e-4)


def exact_turn(moments: tuple[float, ...], w: Array, time: float) -> Array:
    """(3, 3): the rotation after a time, from none; of a body with a round axis z in closed form.

    A symmetric body turns about L at |L| / A, and in its own frame about z at w3 (1 - C / A).
    """
    a, b, c = moments
    if a != b:
        return turn(about_a_point(moments, [0, 0, 0], 0.0, [1, 0, 0, 0], w, time)[0])
    about = np.array(moments) * w / a
    own = w[2] * (1 - c / a)
    return np.asarray((Rotation.from_rotvec(about * time) * Rotation.from_rotvec([0, 0, own * time])).as_matrix())


def turned_freely(name: str, turned: float, dt: float) -> tuple[float, float, float]:
    """Errors after half a second: of the rotation matrix, of the energy, of the angular momentum, relative.

    ``turned``: [rad] in 10 ms, about an axis off all principal ones.
    """
    moments, spin = BODIES[name], turned / 0.01 * np.array([0.8, 0.36, 0.48])
    states = free(moments, dt).states({"b.angular_velocity": spin}, 0.5)
    kept = energy(moments, states)
    _, angular = momenta(free(moments, dt).world, states)
    away = np.abs(exact_turn(moments, spin, 0.5) - turn(states["b.orientation"][-1])).max()
    off = np.abs(angular - angular[0]).max() / np.abs(angular[0]).max()
    return float(away), float(np.abs(kept / kept[0] - 1).max()), float(off)


@few("turned", [0.02, 0.1], 1)
@few("name", ["brick", "coin", "plate"], 1)
def test_free_rotation_converges_at_fourth_order(name: str, turned: float) -> None:
    """Against Euler's equations; angular momentum to rounding at every step."""
    errors = np.array([turned_freely(name, turned, dt) for dt in (0.01, 0.005, 0.0025)])
    assert errors[0, 0] < 6 * turned**4
    assert all(after < max(before / 12, 1e-8) for before, after in pairwise(errors[:, 0]))
    assert errors[2, 1] < max(errors[0, 1] / 100, 1e-11)
    assert errors[:, 2].max() < 1e-11


@few("turned", [0.02, 0.1, 0.3, 0.6, 1.0], 2)
@few("name", BODIES, 3)
def test_free_rotation_keeps_its_energy(name: str, turned: float) -> None:
    """Nothing acts: kinetic energy within 1 %, up to a radian in a step; angular momentum to 1e-9."""
    _, energy_error, momentum_error = turned_freely(name, turned, 0.01)
    assert energy_error < 0.01
    assert momentum_error < 1e-9


def test_gradient_of_a_tumble() -> None:
    """Of an asymmetric body's orientation by the angular velocity it begins with, against the exact motion."""
    at, time = [1.0, 2.0, 0.5], 1.0

    def exact(z: Array) -> Array:
        return exact_turn(MOMENTS, z, time)[:, 0]

    by = differences(exact, at, 1e-4)
    q = ca.SX.sym("q", 4)
    column = ca.Function("column", [q], [ca.jacobian(rotation.matrix(q)[:, 0], q)])
    end, slope = final(free(MOMENTS, 0.01), lambda z: {"b.angular_velocity": z}, time, ["b.orientation"], at)
    assert np.array(column(end)) @ slope == pytest.approx(by, abs=1e-7)
