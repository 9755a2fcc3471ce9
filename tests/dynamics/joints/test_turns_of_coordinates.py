"""Coordinates of one tree: projections that look one ahead give what projections one after the other give."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest

from symphys.dynamics.contact.body_term import BodyTerm
from symphys.dynamics.joints.coordinate_constraint import (
    CoordinateConstraint,
    TreeCoordinate,
    affine_law,
    coupling_to_previous,
    project_sequentially,
)
from symphys.dynamics.joints.joint_impulse import Directions, JointImpulse
from symphys.dynamics.unknowns import GeneralizedVelocities

COUNT, NUMBERS = 5, 7
NOWHERE = Directions(ca.SX(0, 3), ca.SX(0, 3))
BODY = BodyTerm(1, ca.SX(1), ca.SX(1), ca.SX.zeros(3), ca.SX.zeros(3))


def constraints(bounded: bool) -> list[CoordinateConstraint]:
    rng, found = np.random.default_rng(4), []
    for _ in range(COUNT):
        jacobian, response = ca.SX(rng.normal(size=(1, NUMBERS))), ca.SX(rng.normal(size=NUMBERS))
        law = affine_law(ca.SX(rng.normal()), ca.SX(rng.uniform()), ca.SX(rng.uniform(0.5, 2)))
        found.append(
            CoordinateConstraint(
                terms=(BODY,),
                velocity_directions=NOWHERE,
                impulse_directions=NOWHERE,
                **law,
                low=ca.SX(-0.1) if bounded else None,
                high=ca.SX(0.1) if bounded else None,
                width=ca.SX(0),
                same=True,
                of_tree=TreeCoordinate(jacobian, response),
                left=None,
                inverse_mobility=ca.SX(1),
                landing=ca.SX(0),
            )
        )
    return found


@pytest.mark.parametrize("bounded", [False, True])
def test_looking_ahead_changes_nothing(bounded: bool) -> None:
    rng, given = np.random.default_rng(5), constraints(bounded)
    start, old = GeneralizedVelocities(ca.SX(rng.normal(size=NUMBERS))), [JointImpulse(ca.SX(0.05)) for _ in given]
    velocities, impulses = start, []
    for constraint, impulse in zip(given, old, strict=True):
        velocities, new = one(constraint, velocities, impulse)
        impulses.append(new)
    ahead = [given[0], *(replace(then, pushed=coupling_to_previous(first, then)) for first, then in pairwise(given))]
    found, news = project_sequentially(ahead, start, old)
    assert numbers(found.numbers) == pytest.approx(numbers(velocities.numbers), rel=1e-12)
    assert [float(each.numbers) for each in news] == pytest.approx(
        [float(each.numbers) for each in impulses], rel=1e-12
    )
    assert not np.allclose(numbers(found.numbers), numbers(start.numbers))


def one(
    constraint: CoordinateConstraint, velocities: GeneralizedVelocities, impulse: JointImpulse
) -> tuple[GeneralizedVelocities, JointImpulse]:
    """A projection in full."""
    assert constraint.of_tree is not None
    rate = velocities.along(constraint.of_tree.jacobian)
    new = constraint.bounded(constraint.keep * impulse.numbers - constraint.slope * rate - constraint.offset)
    change = new - impulse.numbers
    return GeneralizedVelocities(velocities.numbers + constraint.of_tree.response * change), JointImpulse(new)


def numbers(column: ca.SX) -> np.ndarray:
    return np.array(ca.DM(column)).ravel()
