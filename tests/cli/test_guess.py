"""``symphys solve --guess RUN_FOLDER``: what is said, where runs lie, and what cannot be a guess."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from symphys.runs import read_result

Run = Callable[..., tuple[int, str, str]]


@pytest.mark.slow
def test_a_run_is_the_guess_of_the_next(run: Run, throw: Path, tmp_path: Path) -> None:
    """Its own folder beside, the same command does nothing again, and what is clipped is named once."""
    out = tmp_path / "out"
    command = ["solve", throw, "--solver", "least_squares", "--backend", "casadi", "--no-report", "--out", out]
    assert run(*command)[0] == 0
    first = out / "throw" / "least_squares-seed0"
    code, _, errors = run(*command, "--guess", first)
    (folder,) = out.glob("throw@guess=*")
    again = read_result(folder / "least_squares-seed0" / "result.json")
    assert code == 0 and again.iterations == 0 and again.solved and "clipped" not in errors
    assert (
        f"throw@{folder.name.partition('@')[2]} least_squares seed 0: done"
        in run(*command, "--guess", first, "--dry-run")[1]
    )
    code, _, errors = run(*command, "--seeds", "2", "--set", "throw.upper=1.5", "--guess", first)
    assert code == 1 and errors.count("throw: 1 of 2 numbers are clipped to the bounds") == 1


@pytest.mark.parametrize("folder", [".", "nowhere"])
def test_what_is_no_run(run: Run, throw: Path, tmp_path: Path, folder: str) -> None:
    code, _, errors = run("solve", throw, "--out", tmp_path / "out", "--guess", tmp_path / folder)
    assert code == 2 and "is no run folder; one is, for instance, reports/" in errors
    assert not (tmp_path / "out").exists()
