"""Everything that the command line does, Python does in the same words, and comes to the same."""

from __future__ import annotations

import csv
import signal
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fakes.thread_engine import Threads

import symphys
from symphys.api.checking import TABLE_SUBJECTS
from symphys.cli.app import app
from symphys.cli.examined import Examined

NAME_OF_COMMAND = {
    "list": "problems",
    "ls": "results",
    "best": "results",
    "diff": "results",
    "report": "write_report",
    "open": "write_report",
    "export": "export_problem",
    "replay": "Solution",
    "import": "load_robot",
    "mpc": "Controller",
}


def test_every_command_has_its_name_here() -> None:
    for command in app.commands:
        assert getattr(symphys, NAME_OF_COMMAND.get(command, command), None) is not None
    assert "ball_throw" in symphys.problems.catalogue() and "gradient" in symphys.solvers.SOLVERS


@pytest.mark.slow
def test_check_is_that_of_the_command(problem: symphys.Problem, solution: symphys.Solution) -> None:
    """The same numbers and words, at the guess and at what a solve found."""
    from symphys.transcription import transcribe
    from symphys.verification import examine

    made = transcribe(problem, backend="casadi")
    z = made.shooting.start(0)
    wanted, found = Examined.of(made.judge(z), examine(made, z)), symphys.check(problem)
    assert found.judged == wanted.judged and found.wrong == wanted.wrong is False
    assert [(each.variable, each.error) for each in found.trust.gradient] == [
        (each.variable, each.error) for each in wanted.trust.gradient
    ]
    text = str(found)
    assert found.advice.split()[-1] in text and max(map(len, text.splitlines())) <= 110
    assert all(each.what in text for each in found.findings if each.about not in TABLE_SUBJECTS)
    assert repr(found).startswith("<Check of problem: ") and "<table>" in found._repr_html_()
    at = symphys.check(problem, at=solution)
    assert at.judged.met and not found.judged.met
    assert at.judged.objective == solution.objective == symphys.check(problem, at=solution.folder).judged.objective


def test_check_says_what_cannot_be(problem: symphys.Problem, tmp_path: Path) -> None:
    with pytest.raises(symphys.SymphysError, match="throw"):
        symphys.check(problem, at={"thrwo": [1, 2, 3]})
    with pytest.raises(symphys.SymphysError, match="no run folder"):
        symphys.check(problem, at=tmp_path)
    with pytest.raises(symphys.ProblemError, match="iterations"):
        symphys.check(problem.set("solver.gradient.iteration", 3))


def test_a_gradient_that_is_wrong_is_found(problem: symphys.Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    """Derivatives that are not of this function."""
    from symphys.verification import examination

    right = examination.compare_gradient

    def doubled(*given: Any) -> Any:
        return [{**row, "error": 1.0} for row in right(*given)]

    monkeypatch.setattr(examination, "compare_gradient", doubled)
    found = symphys.check(problem)
    assert found.wrong and "disagrees" in str(found)


@pytest.mark.slow
def test_a_batch_is_every_problem_solver_and_seed(problem: symphys.Problem, tmp_path: Path) -> None:
    """In this order; the folder is that of the command, and the same call does nothing."""
    short = problem.set("solver.gradient.iterations", 3)
    others = [short, short.set("ball.mass", 2.0)]
    seen: list[str] = []
    asked: dict[str, Any] = {"seeds": (3,), "folder": tmp_path, "backend": "casadi"}
    for _ in range(2):
        found = symphys.solve_all(others, ["gradient"], progress=lambda run, row: seen.append(run), **asked)
        runs = [(each.run.problem, each.run.solver, each.run.seed) for each in found]
        assert runs == [("problem", "gradient", 3), ("problem-2", "gradient", 3)]
        assert len(seen) == sum(each.trace.rows for each in found)
    alone = symphys.solve(others[1], "gradient", seed=3, backend="casadi")
    assert np.array_equal(found[1].value["throw"], alone.value["throw"])
    assert found[1].problem.settings == others[1].settings
    page = symphys.write_report(tmp_path)
    assert page == tmp_path / "index.html"
    assert all((each.folder / "report.html").exists() for each in found)


def test_a_run_that_fails_leaves_the_others(problem: symphys.Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is a solution with the reason; without a folder nothing is left when the last one is gone."""
    solve = sys.modules["symphys.runs.execute"].solve  # type: ignore[attr-defined]

    def broken(job: Any, *given: Any) -> Any:
        if job.config.seed == 1:
            raise symphys.SymphysError("nothing works here")
        return solve(job, *given)

    monkeypatch.setattr(sys.modules["symphys.runs.execute"], "solve", broken)
    first, second = symphys.solve_all([problem], ["least_squares"], seeds=2, backend="casadi")
    assert first.solved and (second.run.status, second.advice) == ("failed", "nothing works here")
    out = first.folder.parents[1]
    del first
    assert out.exists()
    del second
    assert not out.exists()


def test_an_interrupted_batch_goes_on(problem: symphys.Problem, tmp_path: Path) -> None:
    def press(run: str, row: Any) -> None:
        if run.endswith("seed 1"):
            signal.raise_signal(signal.SIGINT)

    asked: dict[str, Any] = {"solvers": ["least_squares"], "seeds": 2, "backend": "casadi", "folder": tmp_path}
    with pytest.raises(KeyboardInterrupt, match="1 of 2 runs"):
        symphys.solve_all([problem], progress=press, **asked)
    assert [each.solved for each in symphys.solve_all([problem], **asked)] == [True, True]


def test_a_batch_is_done_by_an_engine(
    problem: symphys.Problem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As it is here; arguments that do not go together are named."""
    monkeypatch.setattr("symphys.batches.following.open_engine", lambda *_: Threads())
    asked: dict[str, Any] = {"solvers": ["least_squares"], "backend": "casadi"}
    (here,) = symphys.solve_all([problem], **asked)
    (there,) = symphys.solve_all([problem], on="dask", folder=tmp_path, **asked)
    assert np.array_equal(here.value["throw"], there.value["throw"])
    for given, said in (
        ({"on": "dask"}, "needs a folder"),
        ({"on": "dusk", "folder": tmp_path}, 'did you mean "dask"'),
        ({"scheduler": "local"}, "needs on"),
        ({"on": "slurm", "folder": tmp_path, "multi_start": True}, "side by side in one process"),
    ):
        with pytest.raises(symphys.SymphysError, match=said):
            symphys.solve_all([problem], **given)


@pytest.mark.slow
def test_show_draws_what_it_is_given(problem: symphys.Problem, tmp_path: Path) -> None:
    """The motion of these values, and a page of it; a robot by itself."""
    figure = symphys.show(problem, throw=[2, 0, 1], page=tmp_path / "page.html")
    path = symphys.simulate(problem, throw=[2, 0, 1])["ball.position"]
    kept = figure.blocks[0]["ball.position.x [m]"]  # type: ignore[attr-defined]
    assert kept == path[:, 0].tolist()
    assert "<canvas" in (tmp_path / "page.html").read_text(encoding="utf-8")
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]
    assert len(symphys.show("robots/arm.toml").axes) >= 1
    with pytest.raises(symphys.SymphysError, match="ball_throw"):
        symphys.show("ball_thrw")


def test_export_writes_what_the_command_writes(problem: symphys.Problem, tmp_path: Path) -> None:
    both = symphys.export_problem(problem, c=tmp_path / "both", casadi=tmp_path / "both")
    assert {path.suffix for path in both} >= {".c", ".h"} and all(path.exists() for path in both)
    assert (tmp_path / "both" / "symphys-export.json").exists()
    with pytest.raises(symphys.SymphysError, match="c='folder'"):
        symphys.export_problem(problem)
    with pytest.raises(symphys.SymphysError, match="ball_throw"):
        symphys.export_problem("ball_thrw", c=tmp_path)


def test_new_overwrites_nothing(tmp_path: Path) -> None:
    file = symphys.new(tmp_path / "mine.toml")
    assert file.read_text(encoding="utf-8") == symphys.load("ball_throw").text
    with pytest.raises(symphys.SymphysError, match="not overwritten"):
        symphys.new(file, "two_balls")
    with pytest.raises(symphys.SymphysError, match="two_balls"):
        symphys.new(tmp_path / "other.toml", "two_bals")


@pytest.mark.slow
def test_figures_of_a_solution_are_files(solution: symphys.Solution, tmp_path: Path) -> None:
    """Those of its report; the numbers are those of its trajectory."""
    page = symphys.write_report(solution.folder)
    assert not (solution.folder / "figures").exists()
    assert symphys.write_report(solution.folder, figures=True) == page
    assert page == solution.folder / "report.html" and "there" in page.read_text(encoding="utf-8")
    paths = solution.save_figures(tmp_path / "paper")
    report = {path.name: path.read_bytes() for path in (solution.folder / "figures").iterdir()}
    assert {path.name: path.read_bytes() for path in paths} == report
    with (tmp_path / "paper" / "states.csv").open(encoding="utf-8", newline="") as file:
        found = [float(row["ball.velocity.z [m/s]"]) for row in csv.DictReader(file)]
    assert found == solution.trajectory["ball.velocity"][:, 2].tolist()
