"""What people are told of recordings."""

from __future__ import annotations

from data.recorded import TABLE, loaded

from symphys.problem.recordings.summary import recording_lines


def test_starts_below_the_ground_are_told() -> None:
    """A ball of 0.1 m whose first recording begins 0.05 m, and whose second begins 0.02 m above the ground."""
    table = {"time": [0, 0.1] * 2, "z": [0.05, 0.1, 0.02, 0.1], "k": [0, 0, 1, 1], "o": [0.0] * 4}
    given = {"table": table, "split": "k", "start": {"ball.position": ["o", "o", "z"]}}
    lines = recording_lines(loaded(given))
    assert (
        "  surfaces overlap by 0.08 m at the start of drop/0001, more than elsewhere; are frame and units right?"
        in lines
    )
    higher = {**given, "table": {**table, "z": [0.2, 0.1, 0.3, 0.1]}}
    assert not any("overlap" in line for line in recording_lines(loaded(higher)))


def test_each_table_has_its_lines() -> None:
    other = {"name": "second", "table": {**TABLE, "z": [1.0, float("nan"), 0.8]}, "held_back": True}
    lines = recording_lines(loaded({"table": TABLE}, other))
    assert [line for line in lines if not line.startswith(" ")] == [
        "drop: 1 motion of 3 samples, until 0.2 s",
        "second: 1 motion of 3 samples, 1 held back, until 0.2 s",
    ]
    assert lines[1:] == [
        "  ball.position[2]: noise estimated",
        lines[2],
        "  ball.position[2]: noise estimated, 1 of 3 samples missing",
    ]
