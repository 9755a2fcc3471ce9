"""Value and gradient are finite wherever two bodies of any shapes happen to be, whatever the law and the smoothing."""

from __future__ import annotations

import numpy as np
import pytest
from random_worlds import STRUCTURES, steps

Structure = tuple[str, str, str, str]
FEW = (2, 6, 7)
"""Structures of the quick test: a box and a capsule under all kinds of laws, on the ground, on hills, at a post."""


def not_finite(structure: Structure, count: int, cuts: int | None) -> set[int]:
    """Which scenes have a value or a derivative that is none, in any of three steps."""
    found = set()
    for scene, after, slope in steps(structure, 1, count, cuts):
        if not (np.isfinite(after).all() and np.isfinite(slope).all()):
            found.add(scene)
    return found


@pytest.mark.parametrize("structure", [STRUCTURES[k] for k in FEW], ids="-".join)
def test_random_scenes_are_finite(structure: Structure) -> None:
    """Touching, overlapping, coincident, aligned, at rest; by state, sizes, place, mass, law and smoothing."""
    assert not_finite(structure, 80, cuts=0) == set()


@pytest.mark.thorough
@pytest.mark.parametrize("structure", STRUCTURES, ids="-".join)
def test_ten_thousand_scenes_are_finite(structure: Structure) -> None:
    """A thousand of each structure, in steps that are cut."""
    assert not_finite(structure, 1000, cuts=None) == set()
