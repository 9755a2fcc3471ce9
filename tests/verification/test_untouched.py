"""A body that a missed target is about and that nothing moves is named, with what came nearest, and nothing else is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from symphys.findings.examination import Examination
from symphys.findings.levels import Judged
from symphys.findings.obstacles import obstacle_findings, obstacles
from symphys.problem import problem_of_tables
from symphys.transcription import Transcription, transcribe
from symphys.verification.near_misses import untouched

MISSED = Judged(1.0, 5.0, False, True, 0.0)


def pushed(y: float, aim: str = "box", **box: Any) -> Transcription:
    """A hand of radius 0.1 that slides along x at 1 m/s for 1 s, past or against a ball of radius 0.1 at (1, y)."""
    floating = {"mass": 1, "shape": {"sphere": {"radius": 0.1}}}
    tables = {
        "simulation": {"duration": 1.0, "dt": 0.01},
        "world": {"gravity": [0, 0, 0]},
        "body": [
            {"name": "hand", **floating, "position": [0, 0, 0]},
            {"name": "box", **floating, "position": [1, y, 0], **box},
        ],
        "variable": [{"name": "speed", "sets": "hand.velocity[0]", "guess": 1.0}],
        "target": [{"name": "there", "value": f"{aim}.position - [2, 0, 0]", "tolerance": 0.01}],
    }
    return transcribe(problem_of_tables(tables), backend="casadi")


def rows(made: Transcription, missed: tuple[str, ...] = ("there",)) -> list[dict[str, Any]]:
    return untouched(made.rollout, made.record(np.array([1.0])), missed)


def test_the_gap_is_that_of_the_closest_approach() -> None:
    """Centres come to 0.3 m of each other when the hand is beside the box, after 1 s."""
    (row,) = rows(pushed(0.3))
    assert (row["body"], row["contact"]) == ("box", "hand-box")
    assert row["gap"] == pytest.approx(0.1, abs=1e-3) and row["time"] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(
    ("made", "missed"),
    [
        (lambda: pushed(0.0), ("there",)),  # it is touched
        (lambda: pushed(0.3), ()),  # what is asked for is met
        (lambda: pushed(0.3, "hand"), ("there",)),  # nothing is asked of it
        (lambda: pushed(0.3, collides_with=[]), ("there",)),  # nothing can touch it
    ],
)
def test_nothing_is_said_of_others(made: Any, missed: tuple[str, ...]) -> None:
    assert rows(made(), missed) == []


def test_what_moves_by_itself_is_not_said_to_be_untouched() -> None:
    tables = pushed(0.3).problem
    own = tables.set("variable.speed.sets", "box.velocity[0]")
    assert rows(transcribe(own, backend="casadi")) == []


def test_the_words_name_body_surface_gap_and_time_where_something_is_missed() -> None:
    found = Examination.from_json({"untouched": [{"body": "box", "contact": "hand-box", "gap": 0.03, "time": 0.4}]})
    (clause,) = obstacles(found, MISSED)
    assert clause.startswith("nothing moves box: the closest approach is 0.03 m (hand-box at t = 0.4 s)")
    (line,) = obstacle_findings(found, MISSED)
    assert line.what == "Nothing moves box" and line.number.startswith("0.03 m (hand-box")
    met = Judged(1.0, 0.5, True, True, 0.0)
    assert obstacles(found, met) == () and obstacle_findings(found, met) == []
