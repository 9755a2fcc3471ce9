"""Which solvers a problem gets that names none: the rules, what follows for shipped problems, where it is said."""

from __future__ import annotations

from pathlib import Path

import pytest

from symphys.problem import Problem, load_problem
from symphys.problems import catalogue
from symphys.report import write_run_report
from symphys.results.run import read_run
from symphys.runs import execute, make_jobs
from symphys.runs.choice import SITUATIONS, chosen, chosen_lines, situation
from symphys.solvers import SOLVERS
from symphys.transcription import transcribe

DOCUMENT = Path(__file__).parents[2] / "docs" / "solvers.md"
POINT = """
[simulation]
duration = 0.1
dt = 0.02

[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1

[[variable]]
name = "push"
SETS

[[target]]
name = "there"
value = "ball.position - [1, 0, 0]"
tolerance = 0.1
"""
CONTROL = 'sets = "ball.force"\nknots = 5'
ALONG = '\n[[cost]]\nname = "effort"\nat = "always"\nsquares = "ball.force"\n'
WHOLE = '\n[[cost]]\nname = "way"\nvalue = "integral(ball.velocity[0])"\n'
MANY = """
[[sensor]]
name = "place"
reads = "ball.position"

[[controller]]
name = "brain"
drives = ["ball.torque"]
senses = ["place"]
net = { hidden = [64] }

[[variable]]
name = "weights"
sets = "brain.weights"
"""
SHARE = '\n[[cost]]\nname = "low"\nvalue = "ball.position[2]"\n'
SCENARIO = '\n[[scenario]]\nname = "heavy"\nsets = "ball.mass"\nfactor = 0.2\n'


def made(tmp_path: Path, sets: str, *more: str) -> Problem:
    path = tmp_path / "point.toml"
    path.write_text(POINT.replace("SETS", sets) + "".join(more), encoding="utf-8")
    return load_problem(path)


@pytest.mark.parametrize(
    ("sets", "more", "solvers"),
    [
        ('sets = "ball.velocity"', "", ["race"]),
        ('sets = "ball.velocity"', SHARE, ["race"]),
        ('sets = "ball.velocity"', SCENARIO, ["stochastic", "evolution"]),
        (CONTROL, "", ["race"]),
        (CONTROL.replace("5", "1"), "", ["race"]),
        (CONTROL, ALONG, ["race"]),
        (CONTROL, WHOLE, ["race"]),
        (CONTROL, MANY, ["gradient"]),
    ],
)
def test_what_is_asked_for_chooses(tmp_path: Path, sets: str, more: str, solvers: list[str]) -> None:
    problem = made(tmp_path, sets, more)
    assert [each.solver for each in chosen(problem)] == solvers
    assert chosen_lines(problem) == [f"point: {each}" for each in chosen(problem)]


def test_those_that_are_named_are_taken(tmp_path: Path) -> None:
    problem = made(tmp_path, CONTROL)
    assert chosen_lines(problem, ["gradient"]) == []
    problem = load_problem(tmp_path / "point.toml")
    (tmp_path / "point.toml").write_text('solvers = ["cma"]\n' + problem.text, encoding="utf-8")
    named = load_problem(tmp_path / "point.toml")
    assert chosen_lines(named) == []
    assert [(job.config.solver, job.chosen) for job in make_jobs([named], None, [0], {}, tmp_path)] == [("cma", "")]


@pytest.mark.slow
def test_solvers_that_are_chosen_are_for_such_problems() -> None:
    """With scenarios or without, as ``Solver.scenarios`` says."""
    for each in SITUATIONS:
        for one in each.solvers:
            assert SOLVERS[one.solver].scenarios in (None, each.name.startswith("scenarios"))
    found = {}
    for name, path in catalogue().items():
        if not name.endswith(("_run", "_walk")):  # some include models of another package
            found[name] = situation(load_problem(path)).name
    assert found["acrobot"] == found["fastest_move"] == "controls over time"
    assert found["ball_throw"] == found["putt"] == "few numbers"
    assert found["arm_reach"] == "many numbers"


def test_the_document_has_the_rules() -> None:
    rows = [
        f"| {each.name if k == 0 else ''} | `{one.solver}` | {one.reason} |"
        for each in SITUATIONS
        for k, one in enumerate(each.solvers)
    ]
    assert "\n".join(rows) in DOCUMENT.read_text(encoding="utf-8")


def test_the_run_and_its_page_say_why(tmp_path: Path) -> None:
    """And say nothing of the kind where the solver was named."""
    problem = made(tmp_path, 'sets = "ball.velocity"')
    for solvers, told in ((None, True), (["least_squares"], False)):
        job = make_jobs([problem], solvers, [0], {}, tmp_path / str(told), examine=False)[0]
        execute(job, lambda row: None, lambda job: transcribe(problem, backend="casadi"))
        run = read_run(job.folder.path, job.folder.path)
        page = write_run_report(job.folder.path).read_text(encoding="utf-8")
        assert ("chosen" in run.provenance) == ("No solver was named: race, since" in page) == told
