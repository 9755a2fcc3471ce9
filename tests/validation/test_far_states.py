"""The step far from any motion, where optimisers with states as variables look: finite, and so are its derivatives."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few, thorough
from worlds.mixed import mixed

from symphys.dynamics.functions import step_function
from symphys.maths.rotation import normalised
from symphys.model.shapes import Box, Capsule, Plane, Sphere, Terrain
from symphys.model.state_layout import Layout, initial_state, input_sizes
from symphys.model.world import Body, Law, Scheme, World, make_world
from symphys.types import Array

INERTIA = (0.02, 0.03, 0.04)
HILLS = Terrain("hills", lambda x, y: 0.1 * ca.sin(3 * x) * ca.cos(2 * y))
WORLDS = {
    "box on a plane": make_world([Body("a", 1.0, INERTIA, (Box((0.2, 0.15, 0.1)),))], [Plane.ground()]),
    "capsule on hills": make_world([Body("a", 1.0, INERTIA, (Capsule(0.1, 0.3),))], [HILLS], Law(0.7, 0.5)),
    "soft ball": make_world([Body.ball("a", 0.2, 1.0)], [Plane.ground()], Law(0.5, 0.0, frequency=5.0)),
    "two balls": make_world([Body("a", 1.0, INERTIA, (Sphere(0.2, (0.1, 0, 0)),)), Body.ball("b", 0.2, 1.0)]),
    "two capsules": make_world([Body(name, 1.0, INERTIA, (Capsule(0.1, 0.3),)) for name in "ab"]),
    "joints": mixed()[0],
}
LONGEST = ("capsule on hills", "two capsules")
SIZES = (1e-6, 1.0, 1e3, 1e6)
FASTEST = {"two capsules": 1e4}
"""[m/s], [rad/s] for worlds whose numbers may overflow at 1e6; docs/python.md says which."""


def far(world: World, rng: np.random.Generator, most: float) -> Array:
    """A state: positions to 1e3 m, all else to ``most``, orientations of any length."""
    layout, x = Layout(world), np.array(initial_state(world)).ravel()
    for name in layout.names():
        part, field = layout[name], name.rpartition(".")[2]
        values = rng.normal(size=part.stop - part.start)
        if field == "orientation":
            x[part] = values * 10.0 ** rng.uniform(-50, 6)
        elif rng.random() < 0.7:
            x[part] = np.clip(values * rng.choice(SIZES), -most, most) * (1e-3 if field == "position" else 1)
    return x


@pytest.mark.slow
@few("name", [*(name for name in WORLDS if name not in LONGEST), *map(thorough, LONGEST)], 1)
def test_steps_from_far_states_are_finite(name: str) -> None:
    """Value, forward and reverse derivatives, exact and smoothed."""
    world = WORLDS[name]
    inputs, rng = list(input_sizes(world)), np.random.default_rng(7)
    step = step_function(world, Scheme(sweeps=3), inputs)
    forward, reverse = step.forward(1), step.reverse(1)
    for k in range(40):
        x, u, s = far(world, rng, FASTEST.get(name, 1e6)), 1e6 * rng.normal(size=step.size1_in(1)), (0.0, 0.1)[k % 2]
        given = [x, u, ca.DM(0, 1), s]
        after = step.call(given)
        slope = forward.call([*given, *after, rng.normal(size=x.shape), rng.normal(size=u.shape), ca.DM(0, 1), 1])
        pulled = reverse.call([*given, *after, rng.normal(size=x.shape)])
        for part in (*after, *slope, *pulled):
            assert np.isfinite(np.array(part)).all(), k


@pytest.mark.slow
@few("length", [1e-150, 1e-3, 0.5, 2.0, 1e6, 1e150], 1)
def test_an_orientation_counts_by_its_direction(length: float) -> None:
    """A step from a quaternion of any length is that from the one of length 1."""
    world = WORLDS["box on a plane"]
    step, layout = step_function(world, Scheme(sweeps=3)), Layout(world)
    values = {"a.position": [0, 0, 0.12], "a.orientation": [0.9, 0.3, -0.1, 0.3], "a.angular_velocity": [1, 2, 3]}
    x = np.array(initial_state(world, values)).ravel()
    turned = layout["a.orientation"]
    x[turned] /= np.linalg.norm(x[turned])
    longer = x.copy()
    longer[turned] *= length
    after, other = (np.array(step(state, [], [], 0)).ravel() for state in (x, longer))
    np.testing.assert_allclose(other, after, rtol=1e-11, atol=1e-11)


def test_an_orientation_of_length_one_stays_as_it_is() -> None:
    """To the bit, with rounding in it; beyond that the length is 1."""
    rng = np.random.default_rng(0)
    for q in rng.normal(size=(100, 4)):
        one = q / np.linalg.norm(q)
        assert np.array_equal(np.array(normalised(ca.DM(one))).ravel(), one)
        assert np.linalg.norm(np.array(normalised(ca.DM(q)))) == pytest.approx(1, abs=1e-15)
