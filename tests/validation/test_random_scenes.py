"""Value and gradient are finite wherever two bodies of any shapes happen to be, whatever the law and the smoothing."""

from __future__ import annotations

import numpy as np
import pytest
from worlds.random_worlds import STRUCTURES, draw, lot, steps

Structure = tuple[str, str, str, str]
FEW = (2, 7)
"""Structures of the short test: a box and a capsule on the ground and at a post, soft and with torsion."""
LARGEST = 1e6
"""Of the numbers of a state: bodies of some kg, tenths of a metre apart, at some m/s."""


def not_finite(structure: Structure, count: int, cuts: int | None) -> set[int]:
    """Which scenes have a value or a derivative that is none, or a body far away, in any of three steps."""
    found = set()
    for scene, after, slope in steps(structure, 1, count, cuts):
        if not (np.isfinite(after).all() and np.isfinite(slope).all() and np.abs(after).max() < LARGEST):
            found.add(scene)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("structure", [STRUCTURES[k] for k in FEW], ids="-".join)
def test_random_scenes_are_finite(structure: Structure) -> None:
    """Touching, overlapping, coincident, aligned, at rest; by state, sizes, place, mass, law and smoothing."""
    assert not_finite(structure, 80, cuts=0) == set()


@pytest.mark.thorough
def test_a_smoothed_contact_that_waits_for_its_impact_is_not_pulled() -> None:
    """It carried load, so that what gapes is closed, but in this part of the step it gives no impulse."""
    parts, rng = lot(*STRUCTURES[1]), np.random.default_rng(1)
    *_, (x, p, smoothing) = (draw(rng, parts.world) for _ in range(606))
    after, slope = (np.array(part) for part in parts.derivatives(x, p, smoothing))
    assert smoothing > 0
    assert np.abs(after).max() < 100
    assert np.isfinite(slope).all()


@pytest.mark.thorough
@pytest.mark.parametrize("structure", STRUCTURES, ids="-".join)
def test_ten_thousand_scenes_are_finite(structure: Structure) -> None:
    """A thousand of each structure, in steps that are cut."""
    assert not_finite(structure, 1000, cuts=None) == set()
