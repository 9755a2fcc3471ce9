"""Joints of all kinds one after another, in chains and side by side, held by the world or by nothing."""

from __future__ import annotations

from itertools import product
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tools.laboratory import Lab
from tools.repeats import thorough
from worlds.linkage import momenta

from symphys.dynamics.observation.joint_coordinates import reading_function
from symphys.model.joints import KINDS as PLAIN
from symphys.model.joints import Joint, JointFrame, helical
from symphys.model.world import Body, Scheme, World
from symphys.types import Array

KINDS = {**PLAIN, "helical": helical(-0.3)}
ROOTS = (None, *KINDS)
TURN = tuple(Rotation.from_euler("xyz", [0.4, -0.7, 0.9]).as_quat(scalar_first=True))
"""Of frames, so that no axis is a body's."""


def tree(root: str | None, kinds: tuple[str, ...], branched: bool) -> tuple[World, dict[str, Any]]:
    """Bodies below each other, or side by side below the first, and where they are if no coordinate has moved.

    ``root``: the kind that holds the first body to the world; None for none.
    """
    joints = [] if root is None else [Joint("root", KINDS[root], 0, None, (JointFrame((0, 0.1, 0.2), TURN),) * 2)]
    start: dict[str, Any] = {"b0.position": np.zeros(3)}
    for k, kind in enumerate(kinds, 1):
        above, y = (0, 0.1 * (-1) ** k) if branched else (k - 1, 0.1)
        frames = JointFrame((0.02, -y, 0.2), TURN), JointFrame((0, y, -0.2), TURN)
        # every other joint is held by its second side, so that both signs occur
        first, second = (k, above) if k % 2 else (above, k)
        joints.append(Joint(f"j{k}", KINDS[kind], first, second, frames if k % 2 else frames[::-1]))
        start[f"b{k}.position"] = start[f"b{above}.position"] + [-0.02, 2 * y, -0.4]
    bodies = tuple(Body(f"b{k}", 1.0 + k, (0.01, 0.02, 0.025)) for k in range(len(kinds) + 1))
    return World(bodies, gravity=(3.0, 0, -9.0) if root else (0, 0, 0), joints=tuple(joints)), start


def check(root: str | None, kinds: tuple[str, ...], branched: bool) -> None:
    """Joints fit to rounding while bodies swing, or tumble with their momenta kept; derivatives are finite."""
    world, start = tree(root, kinds, branched)
    lab = Lab(world, Scheme())
    if root is None:
        for name in [body.name for body in world.bodies]:
            start[f"{name}.angular_velocity"] = spin = np.array([1.0, -2.0, 1.5])
            start[f"{name}.velocity"] = np.cross(spin, start[f"{name}.position"])
    values: Array = np.array(lab.trajectory(start, 0.2))
    assert np.isfinite(values).all()
    read = reading_function(world)
    separations = np.array([read(x, ca.DM(0, 1))[3] for x in values.T])
    assert np.abs(separations).max() < 1e-12
    if root is None:
        linear, angular = momenta(world, {name: values[lab.layout[name]].T for name in lab.layout.names()})
        assert np.abs(linear - linear[0]).max() < 1e-12
        assert np.abs(angular - angular[0]).max() < 1e-12
    u, p = ca.DM.zeros(lab.step.size1_in(1)), ca.DM(0, 1)
    after = lab.step(values[:, -1], u, p, 0)
    slopes = lab.step.reverse(1)(values[:, -1], u, p, 0, after, np.ones(len(values)))[0]
    assert np.isfinite(np.array(slopes)).all()


@pytest.mark.thorough
@pytest.mark.parametrize(("root", "kind"), list(product(ROOTS, KINDS)))
def test_two_bodies(root: str | None, kind: str) -> None:
    check(root, (kind,), False)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("root", "kind"), [pair if k % 2 else thorough(*pair) for k, pair in enumerate(product(ROOTS, KINDS))]
)
def test_three_bodies(root: str | None, kind: str) -> None:
    """Each root with each kind, and each pair of kinds with some root; chains and trees by turns."""
    kinds, where = list(KINDS), list(ROOTS).index(root)
    place = kinds.index(kind) + where
    check(root, (kind, kinds[place % len(kinds)]), bool(place % 2))


@pytest.mark.thorough
@pytest.mark.parametrize("branched", [False, True])
@pytest.mark.parametrize(("root", "kind", "other"), list(product(ROOTS, KINDS, KINDS)))
def test_all_of_three_bodies(root: str | None, kind: str, other: str, branched: bool) -> None:
    check(root, (kind, other), branched)
