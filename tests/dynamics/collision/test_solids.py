"""Gaps of hulls, cylinders, boxes and capsules against each other: MuJoCo's distances, closed forms, either order."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from symphys.dynamics.collision import collide
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.model.shapes import Box, Capsule, Convex, Cylinder
from symphys.model.shapes.hull import Corners, face_table, hull_of
from symphys.types import Array

DT = 0.01


def stone(seed: int, count: int = 14) -> Convex:
    """A hull of points at random, about its centroid."""
    points = np.random.default_rng(seed).normal(size=(count, 3)) * 0.06
    hull = hull_of(Corners(map(tuple, points.tolist())))
    assert hull is not None
    return Convex((hull.corners - hull.centroid).tolist())


def block(x: float, y: float, z: float) -> Convex:
    return Convex([[a, b, c] for a in (-x, x) for b in (-y, y) for c in (-z, z)])


CAN, COIN, BRICK, ROD = Cylinder(0.05, 0.06), Cylinder(0.08, 0.01), Box((0.05, 0.04, 0.06)), Capsule(0.03, 0.05)
PAIRS = {
    "stone-stone": (stone(1), stone(2)),
    "stone-brick": (stone(3), BRICK),
    "stone-can": (stone(4), CAN),
    "rod-stone": (ROD, stone(5)),
    "can-brick": (CAN, BRICK),
    "coin-coin": (COIN, COIN),
    "coin-can": (COIN, CAN),
}
Gaps = Callable[[ArrayLike, ArrayLike, ArrayLike], Array]


def gaps_of(first: Any, second: Any) -> Gaps:
    """From the first's place, orientation matrix and velocity: (4, 3) gap, rate and time; the other is still."""
    place, turn, velocity, zero = ca.SX.sym("p", 3), ca.SX.sym("R", 3, 3), ca.SX.sym("v", 3), ca.SX.zeros(3)
    dt, down = ca.SX(DT), None
    a = PredictedPath(place, turn, velocity, zero, zero, zero, dt, velocity, down)
    b = PredictedPath(zero, ca.SX.eye(3), zero, zero, zero, zero, dt, zero, down)
    found = [ca.horzcat(each.gap, each.rate, each.time) for each in collide(first, second, a, b)]
    made = ca.Function("gaps", [place, turn, velocity], [ca.vertcat(*found)])
    return lambda p, r, v: np.array(made(p, r, v))


def geometry(shape: Any, name: str) -> tuple[str, str]:
    """The geom of a shape in MuJoCo, and its asset."""
    if isinstance(shape, Convex):
        points = " ".join(f"{x:.17g}" for x in np.ravel(shape.points))
        return f'<geom name="{name}" type="mesh" mesh="{name}"/>', f'<mesh name="{name}" vertex="{points}"/>'
    if isinstance(shape, Box):
        return f'<geom name="{name}" type="box" size="{" ".join(map(str, shape.half_sizes))}"/>', ""
    kind = "cylinder" if isinstance(shape, Cylinder) else "capsule"
    return f'<geom name="{name}" type="{kind}" size="{shape.radius} {shape.half_length}"/>', ""


@pytest.mark.parametrize("name", PAIRS)
def test_the_smallest_gap_is_mujocos_distance(name: str) -> None:
    """Of forty poses at random, brought along a line to where MuJoCo has them a millimetre apart, or as deep."""
    mujoco = pytest.importorskip("mujoco")
    first, second = PAIRS[name]
    geoms, assets = zip(geometry(first, "a"), geometry(second, "b"), strict=True)
    bodies = "".join(f'<body mocap="true">{geom}</body>' for geom in geoms)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option ccd_tolerance="1e-9" ccd_iterations="200"/><asset>{"".join(assets)}</asset>'
        f"<worldbody>{bodies}</worldbody></mujoco>"
    )
    data, gaps, rng = mujoco.MjData(model), gaps_of(first, second), np.random.default_rng(7)

    def distance(place: Array, turn: Rotation) -> float:
        data.mocap_pos[0], data.mocap_quat[0] = place, turn.as_quat(scalar_first=True)
        mujoco.mj_kinematics(model, data)
        return float(mujoco.mj_geomDistance(model, data, 0, 1, 1.0, None))

    errors = []
    for _ in range(40):
        turn, way = Rotation.random(rng=rng), rng.normal(size=3)
        way /= np.linalg.norm(way)
        wanted, near, far = rng.choice([1e-3, -1e-3]), 0.0, 0.5
        for _ in range(40):
            middle = (near + far) / 2
            near, far = (near, middle) if distance(middle * way, turn) > wanted else (middle, far)
        errors.append(gaps(far * way, turn.as_matrix(), np.zeros(3))[:, 0].min() - wanted)
    wrong = np.abs(errors)
    assert np.median(wrong) < 1e-6
    assert np.mean(wrong < 3e-4) >= 0.85
    assert wrong.max() < 2e-3


@pytest.mark.parametrize("name", ["stone-brick", "stone-stone"])
def test_gaps_fall_at_the_rate_of_the_motion_and_end_when_they_are_0(name: str) -> None:
    """By differences."""
    first, second = PAIRS[name]
    gaps, rng = gaps_of(first, second), np.random.default_rng(3)
    met = 0
    for _ in range(20):
        turn, way = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
        way /= np.linalg.norm(way)
        place, velocity = 0.13 * way, -2.0 * way + 0.2 * rng.normal(size=3)
        gap, rate, time = gaps(place, turn, velocity).T
        k = int(np.argmin(gap))
        if gap[k] > 0.015:
            continue
        later = gaps(place + 1e-6 * velocity, turn, velocity)[:, 0]
        assert (later.min() - gap[k]) / 1e-6 == pytest.approx(rate[k], rel=1e-3)
        if 0 < time[k] < DT:
            met += 1
            assert gap[k] + rate[k] * time[k] == pytest.approx(0, abs=1e-9)
    assert met > 1


def test_the_faces_of_a_hull_are_whole() -> None:
    """A prism of twelve sides: four corners of its ends that enclose most of them; faces look outward."""
    angles = 2 * np.pi * np.arange(12) / 12
    points = [(np.cos(a), np.sin(a), z) for a in angles for z in (-0.5, 0.5)]
    table = face_table(Corners(points), 0.1)
    assert len(table.normals) == 14 and len(table.edges) == 36
    assert ((table.normals * table.origins).sum(axis=1) > 0).all()
    end = int(np.argmax(table.normals[:, 2]))
    x, y = table.corners[end].T
    assert (x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2 == pytest.approx(2.0)
    assert np.abs(table.core).max() < 1 and np.abs(table.core[:, 2]).max() == pytest.approx(0.45)
