"""Impacts off the centre: no energy from nowhere, momentum and plastic limits; several of them in one step."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from tools.laboratory import Lab
from tools.repeats import few, thorough

from symphys.maths import rotation
from symphys.model.shapes import Box, Plane, Sphere
from symphys.model.world import Body, Law, Scheme, make_world

SIZE = (0.2, 0.3, 0.1)
MOMENTS = tuple((SIZE[(i + 1) % 3] ** 2 + SIZE[(i + 2) % 3] ** 2) / 12 for i in range(3))


@lru_cache
def falling(restitution, friction, cuts, capped, dt=0.01):
    crate = Body("crate", 1.0, MOMENTS, (Box(tuple(s / 2 for s in SIZE)),))
    world = make_world([crate], [Plane.ground()], Law(friction, restitution))
    return Lab(world, Scheme(dt=dt, sweeps=20, cuts=cuts, energy_cap=capped))


def start(seed, height, tilt, spin):
    rng = np.random.default_rng(seed)
    turn = rng.normal(size=3) * tilt
    angle = np.linalg.norm(turn)
    return {
        "crate.position": [0, 0, height],
        "crate.velocity": [1, 0.3, -1],
        "crate.orientation": [np.cos(angle / 2), *(np.sin(angle / 2) * turn / angle)],
        "crate.angular_velocity": rng.normal(size=3) * spin,
    }


def energies(states):
    """Kinetic and potential energy [J] of a body of 1 kg at every step."""
    found = []
    fields = [states[f"crate.{f}"] for f in ("position", "orientation", "velocity", "angular_velocity")]
    for p, q, v, w in zip(*fields, strict=True):
        inside = np.array(rotation.matrix(q)).T @ w
        found.append(0.5 * v @ v + 0.5 * inside @ (np.array(MOMENTS) * inside) + 9.81 * p[2])
    return np.array(found)


def largest_gain(capped):
    """[J] in one step of some tumbling boxes that bounce with e = 1 and mu = 0.5."""
    lab = falling(1.0, 0.5, 2, capped)
    return max(np.diff(energies(lab.states(start(seed, 0.8, 1.0, 3), 1.0))).max() for seed in range(4))


@pytest.mark.slow
def test_newtons_law_with_friction_adds_energy_and_the_cap_does_not():
    """What is left with it is the error of the free motion, at up to 30 rad/s."""
    assert largest_gain(False) > 0.2
    assert largest_gain(True) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize(("restitution", "friction"), [(0.5, 0.2), thorough(0.5, 0.0)])
def test_the_cap_changes_nothing_where_newtons_law_takes_energy_out(restitution, friction):
    at = start(1, 0.5, 0.5, 2)
    with_it, without = (falling(restitution, friction, 2, capped).states(at, 0.25) for capped in (True, False))
    for name, values in with_it.items():
        assert values == pytest.approx(without[name], abs=1e-8), name


@pytest.mark.slow
@pytest.mark.parametrize(("count", "friction"), [thorough(3, 0.2), thorough(12, 0.4)])
def test_a_box_that_lands_on_one_corner_after_the_other_needs_the_cuts(count, friction):
    """Mean error of its place after the landing, against a step of a twentieth: an order of magnitude for two cuts."""
    starts = [start(seed, 0.3, 0.05, 3) for seed in range(count)]
    fine = falling(0.5, friction, 3, True, dt=0.0005)
    exact = [fine.states(at, 0.26)["crate.position"][-1] for at in starts]

    def error(cuts):
        lab = falling(0.5, friction, cuts, True)
        off = [lab.states(at, 0.26)["crate.position"][-1] - end for at, end in zip(starts, exact, strict=True)]
        return np.mean(np.linalg.norm(off, axis=1))

    assert error(2) < 1e-3
    assert error(0) > 10 * error(2)


def test_balls_are_not_held_back():
    """Nothing is hit off its centre there, so that the cap would only cost time."""
    ball = make_world([Body("ball", 1.0, 0.004, (Sphere(0.1),))], [Plane.ground()], Law(0.5, 1.0))
    steps = [Lab(ball, Scheme(energy_cap=capped)).step.n_instructions() for capped in (True, False)]
    assert steps[0] == steps[1]


@lru_cache
def balls(count, restitution, friction, dt=0.01):
    each = [Body(f"ball{k}", 1.0, 0.004, (Sphere(0.1),)) for k in range(count)]
    return Lab(make_world(each, [Plane.ground()], Law(friction, restitution)), Scheme(dt=dt))


def energies_of_balls(states, count):
    """Kinetic and potential energy [J] of balls of 1 kg at every step."""
    found = 0.0
    for k in range(count):
        position, velocity, spin = (states[f"ball{k}.{f}"] for f in ("position", "velocity", "angular_velocity"))
        moving = (velocity**2).sum(axis=1) + 0.004 * (spin**2).sum(axis=1)
        found = found + moving / 2 + 9.81 * position[:, 2]
    return found


KNOCKED_DOWN = {
    "ball0.position": [0, 0, 0.1087],
    "ball0.velocity": [-0.98, 0.09, -0.545],
    "ball1.position": [-0.028, -0.052, 0.3043],
    "ball1.velocity": [-0.6, -0.23, -1.645],
}


@pytest.mark.slow
def test_a_ball_that_another_knocks_down_bounces_before_it_is_hit_again():
    """Both impacts are in one step: the ground throws the lower ball up, behind the upper one that has just left it."""
    coarse = balls(2, 0.9, 0.3).states(KNOCKED_DOWN, 0.02)
    fine = balls(2, 0.9, 0.3, dt=0.0005).states(KNOCKED_DOWN, 0.02)
    assert np.diff(energies_of_balls(coarse, 2)).max() < 1e-9
    for name in ("ball0.velocity", "ball1.velocity"):
        assert coarse[name][-1] == pytest.approx(fine[name][-1], abs=1e-6), name


@pytest.mark.slow
@few("seeds", [(10,), thorough(range(20))], 1)
@few(("count", "restitution", "friction"), [(8, 0.9, 0.3), (8, 1.0, 0.0)], 1)
def test_a_cloud_of_balls_that_falls_gains_nothing(count, restitution, friction, seeds):
    lab = balls(count, restitution, friction)
    for seed in seeds:
        rng, states = np.random.default_rng(seed), {}
        for k in range(count):
            place = np.array([k % 2, k // 2 % 2, k // 4])
            states[f"ball{k}.position"] = [0, 0, 0.15] + 0.21 * place + rng.normal(size=3) * 0.003
            states[f"ball{k}.velocity"] = rng.normal(size=3)
            states[f"ball{k}.angular_velocity"] = rng.normal(size=3) * 5
        energy = energies_of_balls(lab.states(states, 1.0), count)
        assert np.diff(energy).max() < 1e-4 * energy[0], seed
