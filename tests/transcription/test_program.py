"""A rollout as a program of calls gives the numbers of the same rollout as one casadi expression."""

from __future__ import annotations

import numpy as np
import pytest
from tools.repeats import first
from worlds.pushed import PUSHED

from symphys.codegen import compile_program, interpret
from symphys.problem import Problem, load_problem
from symphys.problems import find
from symphys.transcription import rollout_program, transcribe


@pytest.fixture(params=["pushed", "ball_throw", "two_balls"])
def problem(request: pytest.FixtureRequest, tmp_path) -> Problem:
    if request.param == "pushed":
        path = tmp_path / "pushed.toml"
        path.write_text(PUSHED, encoding="utf-8")
        return load_problem(path)
    shorter = {"simulation.duration": 0.25, "variable.force.knots": 120} if request.param == "two_balls" else {}
    return load_problem(find(request.param), shorter)


@pytest.mark.slow
def test_value_and_gradient_are_those_of_the_expression(problem: Problem) -> None:
    transcription = transcribe(problem, backend="casadi")
    program = rollout_program(transcription.rollout)
    kernel = compile_program(program, seeded=("merit",), threads=1)
    z = transcription.shooting.start(1)
    for smoothing in (0.0, 1e-3):
        merit, objective, errors, slope, _ = (
            np.array(part).ravel() for part in transcription.functions.gradient(z, smoothing)
        )
        outputs, gradient = kernel.gradient(z, [1.0], [smoothing])
        for name, expected in (("merit", merit), ("objective", objective), ("errors", errors)):
            assert outputs[name][0] == pytest.approx(expected, rel=1e-12, abs=1e-12)
            assert interpret(program, z, [smoothing])[name] == pytest.approx(expected, rel=1e-12, abs=1e-12)
        assert gradient[0] == pytest.approx(slope, rel=1e-9, abs=1e-11 * np.abs(slope).max())


@pytest.mark.slow
def test_residuals_and_their_jacobian_are_those_of_the_expression() -> None:
    transcription = transcribe(load_problem(find("ball_throw")), backend="casadi")
    kernel = compile_program(rollout_program(transcription.rollout), seeded=("residuals",), threads=1)
    z = transcription.shooting.start(1)
    r, _, _, expected, _ = (np.array(part) for part in transcription.functions.jacobian(z, 0.0))
    assert kernel.forward(z, [0.0])["residuals"][0] == pytest.approx(r.ravel(), rel=1e-12, abs=1e-12)
    jacobian = kernel.jacobian(z, "residuals", [0.0])
    assert jacobian == pytest.approx(expected, rel=1e-9, abs=1e-11 * np.abs(expected).max())


@pytest.mark.slow
@first("name", ["ball_throw", "bank_shot"])
def test_the_exact_kernel_is_the_smoothed_one_at_zero(name: str) -> None:
    rollout = transcribe(load_problem(find(name), {"simulation.duration": 1.0})).rollout
    exact, smoothed = (compile_program(rollout_program(rollout, exact=e), seeded=("merit",)) for e in (True, False))
    Z = np.concatenate([v.guess for v in rollout.problem.variables]) + np.linspace(0, 0.1, 9)[:, None]
    (one, slope), (other, expected) = exact.gradient(Z, [1.0], [0.0]), smoothed.gradient(Z, [1.0], [0.0])
    for output, values in one.items():
        assert values == pytest.approx(other[output], rel=1e-9, abs=1e-12), output
    assert slope == pytest.approx(expected, rel=1e-8, abs=1e-10 * np.abs(expected).max())
    assert exact.report.operations < 0.9 * smoothed.report.operations
