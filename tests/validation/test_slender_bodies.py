"""Slender bodies and fast spins: what turns far in a step keeps its energy, and no wall adds any."""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from tools.repeats import few, first, thorough

from symphys.dynamics.free_rotation import SECOND_ORDER, turned
from symphys.dynamics.functions import step_function
from symphys.maths import rotation
from symphys.model.shapes import Box, Capsule, Plane, Shape
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Body, Law, Scheme, World, make_world
from symphys.types import Array

THROWN: dict[str, Shape] = {
    "capsule": Capsule(0.02, 0.15),
    "stick": Box((0.01, 0.01, 0.25)),
    "pencil": Capsule(0.0035, 0.09),
    "rod": Capsule(0.01, 0.5),
    "plate": Box((0.15, 0.1, 0.005)),
    "die": Box((0.01, 0.01, 0.01)),
}
SOLIDS = {
    "brick": (1.25, 2.0, 2.9),
    "plate": (1.0, 1.9, 2.9),
    "coin": (1.0, 1.0, 2.0),
    "rod": (1.0, 1.0, 0.003),
    "beam": (0.002, 1.0, 1.001),
    "ball": (1.0, 1.0, 1.0 + 1e-9),
}


@cache
def freely(inertia: tuple[float, ...], order: int = 4) -> ca.Function:
    """(q, L, t) -> q after t."""
    q, momentum, t = ca.SX.sym("q", 4), ca.SX.sym("L", 3), ca.SX.sym("t")
    shares = {} if order == 4 else {"shares": SECOND_ORDER}
    return ca.Function("freely", [q, momentum, t], [turned(inertia, q, momentum, t, **shares)])


def energy(inertia: Any, q: Any, momentum: Array) -> float:
    """l . I^-1 l / 2 with l in the body's frame."""
    own = Rotation.from_quat(np.array(q).ravel(), scalar_first=True).inv().apply(momentum)
    return float(np.sum(own**2 / np.array(inertia)) / 2)


@pytest.mark.slow
@few("name", SOLIDS, 2)
@few("angle", [0.1, 0.3, 1.0], 2)
def test_free_rotation_keeps_its_energy(name: str, angle: float) -> None:
    """L . w is constant; ``angle`` [rad] a step; 200 steps, 10 starts; no drift, bounded by the fourth order."""
    inertia, rng = SOLIDS[name], np.random.default_rng(5)
    for _ in range(10):
        w = rng.normal(size=3)
        momentum = np.array(inertia) * w * angle / np.linalg.norm(w)
        q, found = [1.0, 0.0, 0.0, 0.0], []
        for _ in range(200):
            q = freely(inertia)(q, momentum, 1.0)
            found.append(energy(inertia, q, momentum))
        assert np.ptp(found) < 1e-9 + 8e-3 * angle**4 * found[0]
        assert float(ca.norm_2(q)) == pytest.approx(1, abs=1e-14)


@few("name", ["brick", "plate", "coin"], 1)
def test_free_rotation_is_that_of_euler(name: str) -> None:
    """q' = w q / 2, w = I^-1 L by an independent integration; the error falls with the fourth power of the step."""
    inertia, momentum, time = SOLIDS[name], np.array([0.4, -0.7, 0.5]) * np.mean(SOLIDS[name]), 2.0

    def rate(_: float, q: Array) -> Array:
        turn = Rotation.from_quat(q, scalar_first=True)
        w = turn.apply(turn.inv().apply(momentum) / inertia)
        return np.array(rotation.multiply(ca.DM([0, *w]), ca.DM(q))).ravel() / 2

    exact = solve_ivp(rate, (0, time), [1, 0, 0, 0], rtol=1e-12, atol=1e-13).y[:, -1]
    errors = []
    for steps in (40, 80):
        q = ca.DM([1, 0, 0, 0])
        for _ in range(steps):
            q = freely(inertia)(q, momentum, time / steps)
        errors.append(float(ca.norm_2(q - exact)))
    assert errors[0] < 1e-5
    assert errors[1] < errors[0] / 10 or errors[1] < 1e-10


def test_any_tensor_turns_alike() -> None:
    """Principal moments, the same as a tensor in another frame, and as symbols."""
    moment, frame = np.array([1.0, 2.0, 2.5]), Rotation.from_rotvec([0.3, -0.5, 0.8])
    tensor = frame.as_matrix() @ np.diag(moment) @ frame.as_matrix().T
    momentum, t, none = np.array([0.3, -0.2, 0.4]), 0.05, ca.DM([1, 0, 0, 0])
    own = frame.inv().apply(momentum)
    plain = Rotation.from_quat(np.array(freely(tuple(moment))(none, own, t)).ravel(), scalar_first=True)
    exact = np.array(freely(tuple(map(tuple, tensor)))(none, momentum, t)).ravel()
    assert (frame * plain * frame.inv()).as_quat(scalar_first=True) == pytest.approx(exact, abs=1e-7)
    symbols = ca.SX.sym("I", 3, 3)
    rows = tuple(tuple(symbols[i, j] for j in range(3)) for i in range(3))
    of = ca.Function("of", [symbols], [turned(rows, none, ca.DM(momentum), t)])
    assert np.array(of(tensor)).ravel() == pytest.approx(exact, abs=1e-6)


@cache
def wall(name: str, count: int) -> tuple[World, Array, ca.Function]:
    """A body and a wall; its principal moments; ``count`` steps of 10 ms side by side."""
    shape = THROWN[name]
    inertia = tuple(float(moment) for moment in shape.moments)
    world = make_world([Body("b", 1.0, inertia, (shape,))], [Plane("wall", (-1, 0, 0), -1.0)], Law(0.5, 0.5), (0, 0, 0))
    return world, np.array(inertia), step_function(world, Scheme(dt=0.01)).map(count)


def thrown(name: str, speeds: tuple[float, float], count: int) -> Array:
    """(count,) the largest energy of each over 0.4 s, as a share of what it was thrown with; nan if not finite."""
    world, inertia, step = wall(name, count)
    layout, rng = Layout(world), np.random.default_rng(7)
    x = np.tile(np.array(initial_state(world, {})), (1, count))
    q, way = rng.normal(size=(4, count)), rng.normal(size=(3, count))
    way[0] = np.abs(way[0]) + 1
    x[layout["b.orientation"]] = q / np.linalg.norm(q, axis=0)
    x[layout["b.velocity"]] = way / np.linalg.norm(way, axis=0) * rng.uniform(*speeds, size=count)
    x[layout["b.angular_velocity"]] = rng.uniform(-5, 5, size=(3, count))
    x[layout["b.position"].start] = 0.5

    def energies() -> Array:
        turn = Rotation.from_quat(x[layout["b.orientation"]].T, scalar_first=True)
        own = turn.inv().apply(x[layout["b.angular_velocity"]].T)
        return np.asarray((x[layout["b.velocity"]] ** 2).sum(axis=0) + (inertia * own**2).sum(axis=1))

    first, most = energies(), np.zeros(count)
    for _ in range(40):
        x = np.array(step(x, *(ca.DM.zeros(n, count) for n in (0, 0, 1))))
        if not np.isfinite(x).all():
            return np.full(count, np.nan)
        most = np.maximum(most, energies())
    return np.asarray(most / first)


@pytest.mark.slow
@first("speeds", [(5.0, 15.0), (1.0, 5.0)])
@few("name", [*(name for name in THROWN if name != "stick"), thorough("stick")], 1)
def test_no_throw_at_a_wall_gains_energy(name: str, speeds: tuple[float, float]) -> None:
    """e = 0.5, mu = 0.5, 10 ms a step: whatever friction and restitution make of a slender body."""
    assert np.all(thrown(name, speeds, 30) < 1 + 1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize("speeds", [(1.0, 5.0), (5.0, 15.0)])
@pytest.mark.parametrize("name", THROWN)
def test_no_throw_of_a_thousand_gains_energy(name: str, speeds: tuple[float, float]) -> None:
    """The same, 1,000 times."""
    assert np.all(thrown(name, speeds, 1000) < 1 + 1e-6)
