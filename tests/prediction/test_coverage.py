"""Fits of the engine's own recordings: intervals cover the truth, and what is open is named, draw after draw."""

from __future__ import annotations

import pytest
from identify import A_RATIO, NO_EFFECT, covered, named
from tools.repeats import thorough


@pytest.mark.slow
@pytest.mark.parametrize(("draws", "least"), [(3, 1), thorough(100, 90)])
def test_intervals_cover_the_truth_and_are_as_narrow_as_can_be(draws: int, least: int) -> None:
    """90 to 99 of 100, and at most 1.5 times the bound of Cramér and Rao; spins that slide do not hold up the fit."""
    found, ended = covered(draws)
    assert ended == {"converged": draws}
    assert set(found) == {"friction", "bounce"}
    for count, widest in found.values():
        assert least <= count <= max(draws, 3)
        assert draws < 100 or count <= 99
        assert 0.9 < widest < 1.5


@pytest.mark.slow
@pytest.mark.parametrize("draws", [2, thorough(20)])
def test_what_is_open_is_named_in_each_draw(draws: int) -> None:
    assert named(NO_EFFECT, draws) == {"mass has no effect on what was measured": draws}
    ratio = "drag and mass appear only as the ratio drag / mass"
    assert named(A_RATIO, draws) == {ratio: draws}
