"""Joints by point and axis: their frames, where they put bodies, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from typing import Any

import casadi as ca
import numpy as np
import pytest

from symphys import Problem, SymphysError
from symphys.dynamics.observation import readings
from symphys.model import (
    BallJoint,
    Body,
    FixedJoint,
    HelicalJoint,
    Hinge,
    Law,
    Plane,
    Slider,
    UniversalJoint,
    World,
    initial_state,
    make_world,
)

HINGE: dict[str, Any] = {"axis": (0, 1, 0), "point": (0, 0, 1)}


def rods(**keys: Any) -> list[Body]:
    """Two that hang below each other, from a height of 1 m."""
    return [Body.box(name, (0.1, 0.1, 0.4), 1.0, position=(0, 0, z), **keys) for name, z in (("a", 0.8), ("b", 0.4))]


def values(world: World) -> dict[str, list[float]]:
    """The coordinates at the start; every joint holds together there."""
    found = readings(world, initial_state(world))
    for reading in found.values():
        assert np.abs(np.array(ca.evalf(ca.SX(ca.vertcat(reading.separation, reading.tilt))))).max() < 1e-12
    return {name: np.array(ca.evalf(ca.SX(each.value))).ravel().tolist() for name, each in found.items()}


def test_every_kind_begins_where_it_says() -> None:
    """Also bodies that lie askew; a joint moves all that hangs on it, and never what the world holds.

    A problem file that is made of the world begins there too.
    """
    askew = {"orientation": {"roll_deg": 20, "yaw_deg": 50}, "velocity": (1, 2, 3), "angular_velocity": (2, 0, 1)}
    for joint, expected in (
        (Hinge("j", ("a", "b"), axis=(1, 2, 3), point=(0, 0, 0.6), start=0.7), [0.7]),
        (Hinge("j", ("b", "a"), axis=(1, 2, 3), point=(0, 0, 0.6), start=0.7), [0.7]),
        (Slider("j", ("a", "b"), axis=(1, 2, 3), start=-0.2), [-0.2]),
        (HelicalJoint("j", ("a", "b"), axis=(1, 2, 3), pitch=0.3, point=(0, 0, 0.6), start=8.0), [8.0]),
        (HelicalJoint("j", ("b", "a"), axis=(1, 2, 3), pitch=-0.3, point=(0, 0, 0.6), start=8.0), [8.0]),
        (
            UniversalJoint("j", ("a", "b"), axes=((0, 1, 0), (1, 0, 0)), point=(0, 0, 0.6), start=(0.5, -0.3)),
            [0.5, -0.3],
        ),
        (
            UniversalJoint("j", ("b", "a"), axes=((0, 1, 0), (1, 0, 0)), point=(0, 0, 0.6), start=(0.5, -0.3)),
            [0.5, -0.3],
        ),
        (BallJoint("j", ("a", "b"), point=(0, 0, 0.6)), []),
        (FixedJoint("j", ("a", "b")), []),
    ):
        world = make_world(rods(**askew), joints=[Hinge("top", ("world", "a"), **HINGE, start=1.1), joint])
        found, made = values(world), Problem.from_world(world, duration=0.1)
        assert found["top"] == pytest.approx([1.1], abs=1e-12) and found["j"] == pytest.approx(expected, abs=1e-12)
        for name, value in world.start.items():
            assert np.allclose(made.initial[name], value, rtol=0, atol=1e-12)


def test_a_hinge_turns_by_the_right_hand() -> None:
    """About y a rod that hangs swings its lower end towards -x; the one that hangs on it goes along."""
    top, middle = (
        Hinge("top", ("world", "a"), **HINGE, start=pi / 2),
        Hinge("j", ("a", "b"), axis=(0, 1, 0), point=(0, 0, 0.6)),
    )
    start = make_world(rods(), joints=[top, middle]).start
    assert start["a.position"] == pytest.approx((-0.2, 0, 1)) and start["b.position"] == pytest.approx((-0.6, 0, 1))


def test_anchors_are_points_of_bodies() -> None:
    world = make_world(rods(), joints=[BallJoint("j", ("a", "b"), anchors=((0.05, 0, -0.2), (0.05, 0, 0.2)))])
    first, second = world.joints[0].frames
    assert (first.point, second.point) == ((0.05, 0, 0.2), (0.05, 0, -0.2))


def test_joined_bodies_do_not_touch() -> None:
    """Unless their joint lets them; laws are those of two by name, in any order, None for none."""
    hinge = {"axis": (0, 1, 0), "point": (0, 0, 0.6)}
    apart = make_world(rods(), [Plane.ground()], joints=[Hinge("j", ("a", "b"), **hinge)])
    assert {pair.name.partition(":")[0] for pair in apart.pairs} == {"a-ground", "b-ground"}
    laws = {("ground", "a"): Law(0.1), ("b", "ground"): None}
    touching = make_world(rods(), [Plane.ground()], joints=[Hinge("j", ("a", "b"), **hinge, collide=True)], laws=laws)
    found = {pair.name.partition(":")[0]: pair.law for pair in touching.pairs}
    assert found == {"a-ground": Law(0.1), "a-b": Law()}


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Hinge("j", ("a", "c"), **HINGE), r'no body is called "c"; .*valid: world, a, b'),
        (lambda: Hinge("j", ("a", "world"), **HINGE), r'the second must be a body.*\("world", "a"\)'),
        (lambda: Hinge("j", ("a", "a"), **HINGE), "same body twice"),
        (lambda: Hinge("j", ("a",), **HINGE), "must name two bodies"),  # type: ignore[arg-type]
        (lambda: Hinge("j", ("a", "b"), axis=(0, 0, 0), point=(0, 0, 1)), "an axis must not be zero"),
        (lambda: Hinge("j", ("a", "b"), axis=(0, 1), point=(0, 0, 1)), "an axis has three numbers"),
        (lambda: Hinge("j", ("a", "b"), axis=(0, 1, 0)), "point is required"),
        (lambda: Hinge("j", ("a", "b"), axis=(0, 1, 0), point=(0, 0)), "point must be three numbers"),
        (lambda: Hinge("j", ("a", "b"), **HINGE, limits=(1, -1)), "the lower, 1, must be below the upper, -1"),
        (lambda: Hinge("j", ("a", "b"), **HINGE, start=(1, 2)), "a hinge has 1 coordinate, but 2 are given"),
        (lambda: Hinge("j", ("a", "b"), **HINGE, limits=(None, 1), start=2), "2 is beyond the limits"),
        (lambda: Hinge("j", ("a", "b"), **HINGE, frequency=3, start=1), "gives way, so it begins where"),
        (lambda: Hinge("j", ("a", "b"), **HINGE, start=np.nan), "start must be finite, not nan"),
        (lambda: Hinge("j", ("a", "b"), **HINGE, limits=1.5), r"limits must be \(lower, upper\), not 1.5"),
        (lambda: Hinge("j", ("a", "b"), **HINGE, motor=5), "motor must be a Servo, .*, not 5"),
        (lambda: Hinge("j", ("a", "b"), **HINGE, spring=5), "spring must be a Spring, not 5"),
        (lambda: BallJoint("j", ("a", "b"), anchors=((0, 0, 0), (0, 0, 0))), "anchors are 0.4 m apart"),
        (lambda: BallJoint("j", ("a", "b"), point=(0, 0, 1), anchors=((0, 0, 0), (0, 0, 0))), "leave one out"),
        (lambda: UniversalJoint("j", ("a", "b"), axes=((0, 1, 0), (0, 1, 1)), point=(0, 0, 1)), "45 degrees"),
    ],
)
def test_what_cannot_be_is_named(make: Callable[[], Any], said: str) -> None:
    with pytest.raises(SymphysError, match=f'joint "j": .*{said}'):
        make_world(rods(), joints=[make()])


def test_loops_of_starts_and_names_are_refused() -> None:
    loop = [
        Slider("j", ("world", "a"), axis=(0, 0, 1), start=0.1),
        Slider("k", ("world", "a"), axis=(0, 0, 1), start=0.1),
    ]
    with pytest.raises(SymphysError, match=r'joint "k": .*loop'):
        make_world(rods(), joints=loop)
    with pytest.raises(SymphysError, match=r'\("ball", "ground"\): Law\('):
        make_world(rods(), laws={("a", "b"): 0.5})  # type: ignore[dict-item]
    with pytest.raises(SymphysError, match=r"Hinge.*Body"):
        make_world(rods(), joints=rods())  # type: ignore[arg-type]
    with pytest.raises(SymphysError, match='"world"'):
        make_world([Body.ball("world", 0.1, 1.0)], joints=[FixedJoint("j", ("world", "world"))])
    with pytest.raises(SymphysError, match='"a"'):
        make_world([*rods(), *rods()])
    with pytest.raises(SymphysError, match=r'laws: .*"grund".*"ground"'):
        make_world(rods(), [Plane.ground()], laws={("a", "grund"): Law()})
    with pytest.raises(SymphysError, match=r"laws: b and a.*collide=True"):
        make_world(rods(), joints=[FixedJoint("j", ("a", "b"))], laws={("b", "a"): Law()})
