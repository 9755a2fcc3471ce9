"""Motions that are over before their time: nothing moves any more, running costs stop, the time left costs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from symphys.errors import ProblemError
from symphys.problem import load_problem
from symphys.transcription import Transcription, rollout_program, transcribe

DT, HALF = 0.01, 31
"""A ball falls from 1 m; 31 steps end above half a metre, and the next one below."""
BALL = """
[simulation]
duration = 1
dt = 0.01
[[body]]
name = "ball"
shape = { sphere = { radius = 0.1 } }
mass = 1
position = [0, 0, 1]
[termination]
margin = "ball.position[2] - 0.5"
cost = 2
[[variable]]
name = "push"
sets = "ball.velocity"
guess = [1, 0, 0]
[[cost]]
name = "ahead"
at = "always"
value = "ball.position[0]"
[[target]]
name = "there"
value = "ball.position[0] - 1"
tolerance = 0.01
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    found = tmp_path / "ball.toml"
    found.write_text(BALL, encoding="utf-8")
    return found


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Transcription:
    path = tmp_path_factory.mktemp("ball") / "ball.toml"
    path.write_text(BALL, encoding="utf-8")
    return transcribe(load_problem(path))


@pytest.mark.slow
def test_nothing_moves_after_the_termination(ball: Transcription) -> None:
    height = ball.simulate(np.array([1.0, 0, 0])).position[:, 0, 2]
    assert height[HALF] > 0.5 > height[HALF + 1]
    assert np.all(height[HALF + 1 :] == height[HALF + 1])


@pytest.mark.slow
def test_costs_are_those_of_the_time_before(ball: Transcription) -> None:
    """Trapezoids of what is alive: the step of the termination counts half, the time left twice."""
    costs = ball.judge(np.array([1.0, 0, 0])).costs
    assert costs["ahead"] == pytest.approx(DT * DT * (sum(range(HALF + 1)) - HALF / 2 + HALF / 2), rel=1e-9)
    assert costs["termination"] == pytest.approx(2 * (1 - DT * (HALF + 0.5)), rel=1e-12)


def test_gradients_end_at_the_termination(ball: Transcription) -> None:
    """Casadi and kernel agree; the end's target is as far as the ball came; the instant itself has no slope."""
    z, reached = np.array([[1.0, 0, 0]]), DT * (HALF + 1)
    values = [transcribe(ball.problem, backend=name).shooting.evaluator.gradient(z, 0.0) for name in ("casadi", "auto")]
    expected = [ball.judge(z[0]).costs["ahead"] + 2 * (reached - 1) * reached, 0, 0]
    for found in values:
        assert found.gradient is not None
        assert found.gradient[0] == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_discounted_adjoints_end_at_the_termination(ball: Transcription) -> None:
    """The target at the end pulls no longer, since the motion was over."""
    discounted = rollout_program(ball.rollout).discounted
    assert discounted is not None and discounted.kept is not None
    kernel = getattr(ball.shooting.evaluator, "kernel", None)
    if kernel is None:
        pytest.skip("kernels need a compiler")
    seed = [1.0] + [0.0] * (sum(kernel.program.outputs[name].size for name in kernel.seeded) - 1)
    _, gradient = kernel.gradient([1.0, 0, 0], seed, [0.0], 1e-12)
    assert gradient[0] == pytest.approx([ball.judge(np.array([1.0, 0, 0])).costs["ahead"], 0, 0], rel=1e-9)


@pytest.mark.slow
def test_without_a_termination_it_is_as_if_there_were_none(path: Path) -> None:
    """To the bit."""
    free = path.with_name("free.toml")
    free.write_text(BALL.replace("[termination]", "[objective]").replace("margin", "#").replace("cost = 2", ""))
    path.write_text(BALL.replace("- 0.5", "+ 50"), encoding="utf-8")
    a, b = (transcribe(load_problem(file)).shooting.evaluator.gradient(np.array([[1.0, 2, 3]]), 0.0)
            for file in (path, free))  # fmt: skip
    assert a.merit == b.merit
    assert np.array_equal(a.gradient, b.gradient)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("- 0.5", "- 1.5", r"termination\.margin: is -0.5 at the start of the guess"),
        ("ball.position[2] - 0.5", "ball.position", r"termination\.margin: must be a number, but is a vector of 3"),
        ("ball.position[2] - 0.5", "1 - time", r"termination\.margin: .*time"),
        ("ball.position[2] - 0.5", "1 - ball.force[0]", r"termination\.margin: .*ball.force"),
        (
            'name = "ahead"',
            'name = "termination"',
            r'cost "termination"\.name: .*"termination"',
        ),
        ("cost = 2", "cost = -2", r"termination\.cost: .*at least 0"),
    ],
)
def test_bad_terminations_are_named(path: Path, old: str, new: str, told: str) -> None:
    path.write_text(BALL.replace(old, new), encoding="utf-8")
    with pytest.raises(ProblemError, match=told):
        load_problem(path)


def test_alive_is_known_with_a_termination_only(path: Path) -> None:
    path.write_text(BALL.replace("ball.position[0] - 1", "alive"), encoding="utf-8")
    assert load_problem(path).targets[0].formula.names == {"alive"}
    path.write_text(BALL.replace("[termination]", "[objective]").replace("margin", "#").replace("cost = 2", "")
                    .replace("ball.position[0] - 1", "alive"), encoding="utf-8")  # fmt: skip
    with pytest.raises(ProblemError, match="alive"):
        load_problem(path)


def test_the_old_name_goes_on_working(path: Path) -> None:
    """With the name of the table the added cost keeps its name, and so does a fault its place."""
    path.write_text(BALL.replace("[termination]", "[fall]"), encoding="utf-8")
    old = load_problem(path)
    assert [cost.name for cost in old.costs] == ["ahead", "fall"]
    path.write_text(BALL, encoding="utf-8")
    new = load_problem(path)
    assert new.termination == old.termination
    assert [cost.formula.text for cost in new.costs] == [cost.formula.text for cost in old.costs]
    path.write_text(BALL.replace("[termination]", "[fall]").replace("- 0.5", "- 1.5"), encoding="utf-8")
    with pytest.raises(ProblemError, match=r"fall\.margin: .*-0.5"):
        load_problem(path)


def test_both_names_are_refused(path: Path) -> None:
    path.write_text(f'{BALL}\n[fall]\nmargin = "1"\n', encoding="utf-8")
    with pytest.raises(ProblemError, match=r"fall: .*\[termination\]"):
        load_problem(path)


@pytest.mark.parametrize("table", ["fall", "termination"])
@pytest.mark.parametrize("key", ["fall", "termination"])
def test_settings_may_use_either_name(path: Path, table: str, key: str) -> None:
    path.write_text(BALL.replace("[termination]", f"[{table}]"), encoding="utf-8")
    problem = load_problem(path, {f"{key}.cost": 7})
    assert [cost.weight for cost in problem.costs if cost.name == table] == [7]
