"""Sums over long motions are short calls: bits, gradients, and functions that are no longer for more steps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from symphys.codegen import compile_program, interpret
from symphys.problem import Problem, problem_of_tables
from symphys.transcription import rollout_program, transcribe
from symphys.transcription.objective import MIN_SEPARATE_SUM
from symphys.transcription.program import SUM_CHUNK
from symphys.transcription.rollout import symbolic_rollout

FREE = {"value": "0.1 * ball.position[0] + 0.2", "weight": 0.3}
TABLES: dict[str, Any] = {
    "body": [{"name": "ball", "shape": {"sphere": {"radius": 0.1}}, "mass": 0.5, "position": [0, 0, 0.3]}],
    "ground": {"restitution": 0.5},
    "variable": [{"name": "push", "sets": "ball.force", "knots": 3, "guess": [0.3, -0.2, 0.1]}],
    "cost": [
        {"name": "effort", "at": "always", "squares": "ball.force", "weight": 0.7},
        {"name": "far", "at": "always", "squares": "ball.position[0:2]", "weight": 0.2},
        {"name": "free", "at": "always", **FREE},
        {"name": "late", "during": "late", **FREE},
    ],
    "phase": [{"name": "early", "until": 0.5}, {"name": "late"}],
    "target": [{"name": "there", "value": "ball.position[0:2] - [1, 0]", "tolerance": 0.1}],
}


def problem(steps: int, costs: int = 4) -> Problem:
    tables = {**TABLES, "cost": TABLES["cost"][:costs]}
    return problem_of_tables({"simulation": {"duration": 0.005 * steps, "dt": 0.005}, **tables})


@pytest.mark.slow
def test_a_program_adds_up_what_the_expression_does() -> None:
    made = transcribe(problem(301), backend="casadi")
    program = rollout_program(made.rollout)
    assert len(program.epilogue) > 2 * 301 * 3 / SUM_CHUNK > 2 * MIN_SEPARATE_SUM / SUM_CHUNK
    kernel = compile_program(program, seeded=("merit",), threads=1)
    z = made.shooting.start(0)
    for smoothing in (0.0, 0.01):
        wanted = made.functions.gradient(z, smoothing)
        outputs, slopes = kernel.gradient(z[None], [1.0], [smoothing])
        assert outputs["objective"][0, 0] == float(wanted[1])
        assert outputs["probe"][0, 0] == interpret(program, z, [smoothing])["probe"][0]
        assert slopes[0] == pytest.approx(np.array(wanted[3]).ravel(), rel=1e-9, abs=1e-12)
    assert outputs["costs"][0] == pytest.approx(list(made.judge(z, 0.01).costs.values()), rel=0, abs=0)


def test_functions_are_no_longer_for_more_steps() -> None:
    def lengths(steps: int) -> set[int]:
        program = rollout_program(symbolic_rollout(problem(steps, 3)))
        return {call.function.n_instructions() for call in program.epilogue}

    assert max(lengths(640)) == max(lengths(1280)) < 1000
