"""``symphys check`` describes and examines a problem, and its exit code is what the examination found."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., tuple[int, str, str]]


def test_check_describes_the_file_and_compares_gradients(run: Run, throw: Path) -> None:
    code, out, _ = run("check", throw)
    assert code == 0
    for words in ("A short throw", "10 steps", "sets ball.velocity", "is at half a metre", "agrees"):
        assert words in out
    assert "is at half a metre: ball.position[0:2] - [0.5, 0] (end, in m)" in out


def test_check_says_that_a_list_gets_the_same_values(run: Run, throw: Path) -> None:
    more = '[[variable]]\nname = "both"\nsets = ["ball.force[0]", "ball.force[1:3]"]\nknots = 5\n'
    text = throw.read_text(encoding="utf-8")
    throw.write_text(text + more, encoding="utf-8")
    assert "sets quantities with different numbers of components" in run("check", throw)[2]
    throw.write_text(text + more.replace("1:3", "2"), encoding="utf-8")
    out = run("check", throw)[1]
    assert "  variable     both: 5 numbers, sets ball.force[0] and ball.force[2] to the same values\n" in out
    assert out.count("to the same values") == 1


@pytest.mark.slow
def test_check_and_solve_say_which_solvers_are_taken_and_why(run: Run, throw: Path) -> None:
    """Where none is named; a list in the file is only repeated, and events and silence stay clean."""
    since = "race, since a search passes kinks and plateaus, and a method that follows derivatives finishes"
    assert f"  solver       {since}" in run("check", throw)[1]
    code, table, err = run("solve", throw, "--backend", "casadi", "--unexamined", "--no-report")
    assert code == 0 and f"throw: {since}\n" in err
    assert "gradient" not in table and table.count("1/1") == 1
    assert run("solve", throw, "--backend", "casadi", "--unexamined", "--no-report", "--quiet")[2] == ""
    assert "since" not in run("solve", throw, "--solver", "cma", "--backend", "casadi", "--unexamined")[2]
    throw.write_text('solvers = ["cma"]\n' + throw.read_text(encoding="utf-8"), encoding="utf-8")
    assert "  solvers      cma, as the file says" in run("check", throw)[1]


def test_check_calls_no_gradient_right_that_nothing_depends_on(run: Run, throw: Path) -> None:
    text = throw.read_text(encoding="utf-8")
    throw.write_text(text.replace("ball.position[0:2] - [0.5, 0]", "ball.position[2] - 3"), encoding="utf-8")
    words = " ".join(run("check", throw)[1].split())
    assert words.count("The gradient of throw is zero or negligible") == 2
    assert "gradient is right" not in words and "reliable over" not in words


@pytest.mark.slow
def test_check_tells_of_falls_and_scenarios(run: Run, throw: Path) -> None:
    text = throw.read_text(encoding="utf-8")
    more = '[fall]\nmargin = "ball.position[2] + 9"\n[[scenario]]\nname = "masses"\nsets = "ball.mass"\nfactor = 0.1\n'
    throw.write_text(text + more, encoding="utf-8")
    code, out, _ = run("check", throw)
    assert code == 0
    assert "over         where ball.position[2] + 9 < 0" in out
    assert "differs      masses" in out


def test_check_exits_1_where_the_gradient_is_wrong(run: Run, throw: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = [{"variable": "throw", "error": 0.5, "scale": 1.0}]
    monkeypatch.setattr("symphys.verification.examination.compare_gradient", lambda *given: wrong)
    code, out, _ = run("check", throw)
    assert code == 1
    assert "disagrees" in out
    assert "The gradient is misleading" in " ".join(out.split())


def test_check_exits_1_where_a_number_is_not_finite(run: Run, throw: Path) -> None:
    text = throw.read_text(encoding="utf-8")
    throw.write_text(text.replace("ball.position[0:2] - [0.5, 0]", "sqrt(ball.position[0] - 1)"), encoding="utf-8")
    code, out, _ = run("check", throw)
    assert code == 1
    assert "target 'is at half a metre' is not finite at t = 0.2 s: sqrt(-0.8)" in " ".join(out.split())
    push = '[[force]]\nname = "push"\non = "ball.force"\nvalue = "[exp(1e5 * time), 0, 0]"\n'
    throw.write_text(text + push, encoding="utf-8")
    code, out, _ = run("check", throw)
    assert (
        code == 1 and "not finite from step" in out and "it begins in the output of controllers and force laws" in out
    )


@pytest.mark.slow
def test_check_can_look_at_what_a_run_found(run: Run, throw: Path, unreachable: Path) -> None:
    run("solve", throw, "--solver", "least_squares")
    code, out, _ = run("check", throw, "--at", "reports/throw/least_squares-seed0")
    assert code == 0
    assert "still meets every check" in " ".join(out.split())
    assert "still meets" not in " ".join(run("check", throw)[1].split())
    other = throw.with_name("other.toml")
    other.write_text(throw.read_text(encoding="utf-8").replace('name = "throw"', 'name = "kick"'), encoding="utf-8")
    code, _, err = run("check", other, "--at", "reports/throw/least_squares-seed0")
    assert code == 2 and "'kick'" in err
    assert run("check", throw, "--at", "nowhere")[0] == 2


def test_check_lists_recordings(run: Run) -> None:
    """How many, of what, what is missing and held back; without an objective nothing else is examined."""
    code, out, _ = run("check", "bounce_recorded")
    assert code == 0
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert "variable let_go: 1 number for each recording, sets ball.position[2]" in lines
    assert "recording drops: 3 motions of 56 samples, 1 held back, until 1.1 s" in lines
    assert "ball.position[2]: noise 0.002, 1 of 168 samples missing" in lines
    assert not any(line.startswith("solver") or "steps of 0.01 s apart" in line for line in lines)
    assert "There is no objective but the recordings" in out


def test_check_says_where_samples_lie_between_steps(run: Run) -> None:
    out = run("check", "bounce_recorded", "--set", "simulation.dt=0.0125", "--set", "simulation.duration=1.125")[1]
    assert "samples are 1.6 steps of 0.0125 s apart, so that most fall between two steps; dt = 0.01 would fit" in out
