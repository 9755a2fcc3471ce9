"""One call solves: options as keywords, a folder if one is wanted, errors in words."""

from __future__ import annotations

import copy
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from worlds.thrown import TABLES

import symphys
from symphys.errors import SymphysError


def test_the_solution_is_that_of_the_variables(problem: symphys.Problem, solution: symphys.Solution) -> None:
    """Judged as the motion with its values is; arrays are named and of the shapes that are promised."""
    assert solution.solved and solution.verdict == "solved"
    assert solution.value["throw"].shape == (3,) and solution.value["push"].shape == (3, 1)
    motion = symphys.simulate(problem, solution.value)
    assert np.array_equal(motion["ball.position"], solution.trajectory["ball.position"])
    assert np.linalg.norm(motion["ball.position"][-1] - [1, 0, 0.3]) <= 0.01
    assert solution.outputs["height [m]"] == pytest.approx(motion["ball.position"][-1, 2], rel=1e-12)
    assert [check.met for check in solution.checks] == [True]
    assert list(solution.costs) == ["effort"]


def test_options_are_keywords(problem: symphys.Problem) -> None:
    """As in the table of the solver; they are kept with the run."""
    found = symphys.solve(problem, "gradient", seed=3, iterations=1, backend="casadi")
    assert (found.run.solver, found.run.seed, found.run.iterations, found.solved) == ("gradient", 3, 1, False)
    assert found.problem.solver_tables["gradient"] == {"iterations": 1}
    assert found.advice


@pytest.mark.parametrize(
    ("solver", "options", "said"),
    [("gradint", {}, "gradient"), ("gradient", {"iteration": 3}, "iterations"), ("cma", {"sigma": -1}, "sigma")],
)
def test_what_cannot_be_is_said(problem: symphys.Problem, solver: str, options: dict[str, Any], said: str) -> None:
    with pytest.raises(symphys.SymphysError, match=said):
        symphys.solve(problem, solver, backend="casadi", **options)


def test_a_folder_keeps_the_run(problem: symphys.Problem, tmp_path: Path) -> None:
    """It is read again, and the same call does nothing; another folder is not touched."""
    seen: list[int] = []
    first, again = (
        symphys.solve(problem, "least_squares", folder=tmp_path, backend="casadi", progress=lambda row: seen.append(1))
        for _ in range(2)
    )
    rows = first.trace.rows
    assert len(seen) == rows and again.run == first.run
    read = symphys.read(tmp_path / problem.name / "least_squares-seed0")
    assert read.run == first.run and read.problem.text == problem.text
    assert np.array_equal(read.trajectory.position, first.trajectory.position)


def test_without_a_folder_nothing_is_left(problem: symphys.Problem) -> None:
    found = symphys.solve(problem, "least_squares", backend="casadi")
    folder = found.folder
    assert folder.exists()
    del found
    assert not folder.exists()


def test_what_is_interrupted_goes_on(problem: symphys.Problem, tmp_path: Path) -> None:
    """To the same end as without."""
    whole = symphys.solve(problem, "cma", backend="casadi", evaluations=200)

    def press(row: Any) -> None:
        if row.iteration == 2:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt, match="cma-seed0"):
        symphys.solve(problem, "cma", folder=tmp_path, backend="casadi", progress=press, evaluations=200)
    found = symphys.solve(problem, "cma", folder=tmp_path, backend="casadi", evaluations=200)
    assert np.array_equal(found.value["throw"], whole.value["throw"])


def test_a_start_that_is_not_finite_is_no_solution() -> None:
    """It is a result with advice, like every end of a solver."""
    tables = copy.deepcopy(TABLES)
    tables["cost"].append({"name": "none", "value": "1 / (ball.position[1] * 0)"})
    found = symphys.solve(tables, "gradient", backend="casadi")
    assert not found.solved and found.run.status == "not_finite"
    assert "look at the guess" in found.advice


def test_a_run_that_fails_raises(problem: symphys.Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    """What cannot even be begun has no result."""

    def broken(*given: Any) -> Any:
        raise symphys.SymphysError("nothing works here")

    monkeypatch.setattr("symphys.api.solving.transcribed", broken)
    with pytest.raises(symphys.SymphysError, match="nothing works here"):
        symphys.solve(problem, "gradient", backend="casadi")


@pytest.mark.parametrize(
    ("call", "valid"),
    [
        (lambda: symphys.solve("ball_throw", "multiple_shooting", backend="ipopt"), "cuda32, c, casadi"),
        (lambda: symphys.solve_all(["ball_throw"], backend="ipopt"), "cuda32, c, casadi"),
        (lambda: symphys.compile("ball_throw", backend="ipopt"), "cuda32, c, casadi"),
        (lambda: symphys.compile_step("cart_pole", backend="ipopt"), "cuda32, casadi"),
    ],
)
def test_a_backend_that_is_none(call: Callable[[], object], valid: str) -> None:
    """Such as a name that is one of an option of a solver."""
    with pytest.raises(SymphysError, match=f"'ipopt'.*auto, simd, simd32, cuda, {valid}$"):
        call()


def test_read_names_what_is_no_run(tmp_path: Path) -> None:
    with pytest.raises(symphys.SymphysError, match=r"no run folder"):
        symphys.read(tmp_path)


@pytest.mark.slow
def test_a_batch_has_limits_and_does_again_what_is_asked_for(tmp_path: Path) -> None:
    for given in ({"rerun": "faild"}, {"retries": -1}, {"timeout": 0.0}, {"budget": -1.0}):
        with pytest.raises(SymphysError, match=r"failed|retries"):
            symphys.solve_all(["ball_throw"], ["least_squares"], folder=tmp_path, **given)  # type: ignore[arg-type]
    written = []
    for rerun in (None, None, "all"):
        symphys.solve_all(["ball_throw"], ["least_squares"], backend="casadi", folder=tmp_path, rerun=rerun)
        written.append((tmp_path / "ball_throw/least_squares-seed0/result.json").stat().st_mtime_ns)
    assert written[0] == written[1] != written[2]
