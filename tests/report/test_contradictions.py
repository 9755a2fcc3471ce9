"""Nothing on a page speaks against its verdict, and no number on it is rounding."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tools.contradictions import contradictions, words

import symphys
from symphys.findings.advice import advice, findings
from symphys.findings.examination import Examination, GradientCheck, Growth, Refined
from symphys.findings.levels import BAD, Judged
from symphys.findings.verdict import doubts
from symphys.report import write_run_report

MET = Judged(1.0, 0.5, True, True, 1.0)
SIZES = st.floats(1e-14, 1e6)


@given(
    st.builds(
        Examination,
        gradient=st.lists(st.builds(GradientCheck, st.just("push"), SIZES, SIZES, felt=SIZES), max_size=2).map(tuple),
        refined=st.lists(
            st.builds(Refined, st.sampled_from(["dt / 2", "sweeps x 2"]), SIZES, SIZES, st.just({"push": 3.0})),
            max_size=2,
        ).map(tuple),
        growth=SIZES.map(lambda size: Growth(np.array([0.0, 1.0]), np.array([size, 1.0]))),
        residual=SIZES,
        impulse=SIZES,
        deepest=SIZES,
        size=SIZES,
        multiple_impacts=st.sampled_from([0.0, 3.0]),
    )
)
def test_what_is_accepted_is_not_called_bad(trust: Examination) -> None:
    """Neither line by line nor in the advice, where nothing refutes a result."""
    if doubts(trust, MET):
        return
    accepted = Judged(1.0, 0.5, True, True, 1.0, accepted=True)
    assert BAD not in [line.level for line in findings(trust, accepted)]
    said = advice(trust, accepted)
    assert not any(word in said for word in ("does not hold", "misleading", "not to be trusted", "another guess"))


@pytest.mark.parametrize("run", ["ball_throw/gradient-seed0", "two_balls/gradient-seed0", "ball_throw/cma-seed3"])
def test_pages_of_made_up_runs(batch: Path, run: str) -> None:
    assert contradictions(batch / run) == []


def test_a_solved_run_is_not_asked_for_more_time(run_dir: Path, edit: Callable[..., None]) -> None:
    edit(run_dir / "result.json", status="budget", advice="the time is used up: raise `max_seconds`")
    said = words(write_run_report(run_dir))
    assert "a larger budget may lower the costs (the time is used up: raise `max_seconds`)" in said
    assert contradictions(run_dir) == []


SOLVED = {
    "acrobot": ("ilqr", {}),
    "ball_throw": ("least_squares", {}),
    "cart_pole_walls": ("ilqr", {}),
    "hopper_jump": ("gradient", {}),
    "transport": ("ilqr", {}),
    "planar_hopper": ("ilqr", {"iterations": 3}),
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", SOLVED)
def test_pages_of_shipped_problems(name: str, tmp_path: Path) -> None:
    solver, options = SOLVED[name]
    symphys.solve(symphys.load(name), solver, folder=tmp_path / "out", **options)
    (result,) = (tmp_path / "out").rglob("result.json")
    assert contradictions(result.parent) == []
