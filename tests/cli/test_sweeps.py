"""``symphys solve --sweep``: a run folder for each point, the same as with --set; the table of many rows."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

import symphys
from symphys.cli.arguments import points_of, read_problems, read_sweeps
from symphys.cli.summary import MAX_ROWS, advice_together, best_and_worst, fitting_table
from symphys.problem.sweeps.points import LazyProblem
from symphys.results.result import CheckRecord
from symphys.runs import Result, read_result

QUICK = ("--backend", "casadi", "--unexamined", "--solver", "least_squares", "--no-report", "--out", "o")
TABLE = """
[sweep]
"ball.mass" = [1, 2]
"""
Run = Callable[..., tuple[int, str, str]]


def cases() -> list[str]:
    return sorted(path.name for path in Path("o").iterdir() if path.is_dir())


def test_each_point_has_the_folder_of_its_settings_and_is_done_once(run: Run, throw: Path) -> None:
    code, _, _ = run("solve", throw, "--set", "ball.mass=2", "--set", "target.0.tolerance=0.02", *QUICK)
    assert code == 0
    sweep = ("--sweep", "ball.mass=1:2:2", "--sweep", "target.0.tolerance=0.02,0.03")
    code, out, err = run("solve", throw, *sweep, *QUICK)
    assert code == 0
    assert cases() == [
        f"throw@ball.mass={mass},target.0.tolerance=0.0{tolerance}" for mass in (1, 2) for tolerance in (2, 3)
    ]
    assert out.count("1/1") == 4
    assert err.count("done before") == 1
    for case in cases():
        assert read_result(Path("o") / case / "least_squares-seed0" / "result.json").solved
    _, _, err = run("solve", throw, *sweep, *QUICK)
    assert err.count("done before") == 4
    assert symphys.read(Path("o") / cases()[0] / "least_squares-seed0").problem.parameters["ball.mass"] == 1


@pytest.mark.slow
def test_a_file_may_sweep_and_what_is_swept_is_no_part_of_a_problem(run: Run, throw: Path) -> None:
    run("solve", throw, "--set", "ball.mass=2", *QUICK)
    throw.write_text(throw.read_text() + TABLE)
    _, _, err = run("solve", throw, *QUICK)
    assert cases() == ["throw@ball.mass=1", "throw@ball.mass=2"]
    assert err.count("done before") == 1
    run("solve", throw, "--sweep", "none", *QUICK)
    assert cases() == ["throw", "throw@ball.mass=1", "throw@ball.mass=2"]
    assert "sweep        2 points, a grid of ball.mass" in run("check", throw)[1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--sweep", "ball.mass=1:2:x"), "--sweep 'ball.mass=1:2:x': ball.mass needs a whole number of values"),
        (("--sweep", "ball.mass=1,0"), 'body "ball".mass: must be greater than 0, not 0 (at the point ball.mass=0'),
        (("--sweep", "ball.mass=1,2", "--set", "ball.mass=2"), "ball.mass is set to one value (--set), and swept"),
        (("--sweep", "ball.mass=1:2"), "ball.mass needs a count in a grid"),
        (("--samples", "lhs:3"), "there is nothing to sample"),
        (("--sweep", "ball.mass=1:2", "--samples", "sobol:3"), "--samples 'sobol:3': a count of Sobol points"),
        (("--sweep", "solver.least_squares.iterations=5,x"), "solver.least_squares.iterations: must be a whole number"),
    ],
)
def test_a_sweep_that_cannot_be_exits_2_before_anything_is_solved(
    run: Run, throw: Path, arguments: tuple[str, ...], message: str
) -> None:
    code, out, err = run("solve", throw, *QUICK, *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert not Path("o").exists()


def test_two_problems_are_swept_alike_each_with_its_own_table(throw: Path, unreachable: Path) -> None:
    throw.write_text(throw.read_text() + TABLE)
    found = read_sweeps(read_problems([str(throw), str(unreachable)], {}), ["simulation.sweeps=4,5"], None)
    shown: list[dict[str, float]] = []
    points = list(points_of(found, lambda name, parts: shown.append(parts)))  # type: ignore[arg-type,func-returns-value]
    assert [(point.name, len(point.settings)) for point in points] == [("throw", 2)] * 4 + [("unreachable", 1)] * 2
    assert all(isinstance(point, LazyProblem) for point in points)
    assert shown == []  # too few to be told of


def test_python_sweeps_by_a_table(throw: Path, tmp_path: Path) -> None:
    problem = symphys.load(throw)
    table = {"ball.mass": [1, 2], "samples": "grid"}
    found = symphys.solve_all(
        [problem, problem], ["least_squares"], backend="casadi", sweep=table, folder=tmp_path / "kept"
    )
    assert [solution.run.problem for solution in found] == ["throw", "throw", "throw-2", "throw-2"]
    assert [solution.problem.parameters["ball.mass"] for solution in found] == [1, 2, 1, 2]
    assert all(solution.solved for solution in found)
    folders = {path.name for path in (tmp_path / "kept").iterdir()}
    assert {"throw@ball.mass=1", "throw-2@ball.mass=2"} <= folders
    with pytest.raises(symphys.SymphysError, match="did you mean"):
        symphys.solve_all([problem], ["least_squares"], sweep={"ball.mas": [1]})


def test_python_takes_the_sweep_of_a_file_unless_told(throw: Path) -> None:
    throw.write_text(throw.read_text() + TABLE)
    assert len(symphys.solve_all([throw], ["least_squares"], backend="casadi")) == 2
    assert len(symphys.solve_all([throw], ["least_squares"], backend="casadi", sweep={})) == 1


def outcome(solved: bool, number: float) -> Result:
    """A run with this objective, or, not solved, with this largest error over its tolerance."""
    check = CheckRecord("target", "there", 0.1 * number, 0.1, number, solved, "m")
    status, said = ("met", "") if solved else ("converged", "Try.")
    made = Result(problem="p", title="", solver="s", seed=0, solved=solved, status=status, advice=said)
    objective = number if solved else 0.0
    return replace(made, verdict="solved" if solved else "not solved", objective=objective, checks=(check,))


def test_of_many_rows_the_best_and_the_worst_are_shown() -> None:
    groups = {(f"p@x={k}", "s"): [outcome(k % 2 == 0, float(k))] for k in range(100)}
    shown = list(best_and_worst(groups))
    half = MAX_ROWS // 2
    assert [name for name, _ in shown[:half]] == [f"p@x={k}" for k in range(0, 2 * half, 2)]
    assert [name for name, _ in shown[-half:]] == [f"p@x={k}" for k in range(100 - 2 * half + 1, 100, 2)]
    few = dict(list(groups.items())[:MAX_ROWS])
    assert list(best_and_worst(few)) == list(few)
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(fitting_table(best_and_worst(groups), 120, 100 - len(shown)))
    rows = [line for line in console.export_text().splitlines() if line.strip()]
    assert any("... 70 more ..." in row for row in rows)
    assert sum("p@x=" in row for row in rows) == MAX_ROWS


def test_what_is_said_of_many_rows_is_said_once() -> None:
    groups = {(f"p@x={k}", "s"): [outcome(False, 2.0)] for k in range(40)}
    assert advice_together(groups) == [
        'p@x=0 s and 39 more: missed: "there" by 0.2 m (tolerance 0.1 m)',
        "p@x=0 s and 39 more: Try.",
    ]
