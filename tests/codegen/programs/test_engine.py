"""The engine's own step as the one call of a program: every operation that physics uses, through bounces."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from symphys.codegen import (
    Cache,
    FunctionCall,
    Kernel,
    MemoryLayout,
    Program,
    compile_program,
    interpret,
)
from symphys.dynamics.functions import step_function
from symphys.problem import load_problem
from symphys.problems import find
from symphys.transcription.rollout import symbolic_rollout

STEPS = 120


@pytest.fixture(scope="module")
def throw(cache: Cache) -> Kernel:
    problem = load_problem(find("ball_throw"))
    rollout = symbolic_rollout(problem)
    step = step_function(rollout.world, problem.simulation.scheme(), rollout.inputs, rollout.parameters.symbols)
    z, at = ca.SX.sym("z", rollout.z.numel()), MemoryLayout()
    start = ca.Function("start", [rollout.z], [rollout.x[:, 0]]).expand()
    begin = ca.Function("begin", [z], [ca.densify(start(z))])
    x = ca.SX.sym("x", step.numel_in(0))
    end = ca.Function("end", [x], [x + 0])
    decision, smoothing, none = at.take(z.numel()), at.take(1), at.take(0)
    states, last = at.series(x.numel(), STEPS + 1), at.take(x.numel())
    program = Program(
        size=at.size,
        z=decision,
        parameters=smoothing,
        steps=STEPS,
        prologue=(FunctionCall(begin, (decision,), (states,)),),
        body=(FunctionCall(step, (states, none, none, smoothing), (states.later(),)),),
        epilogue=(FunctionCall(end, (states.later(STEPS),), (last,)),),
        outputs={"state": last},
    )
    return compile_program(program, cache=cache)


@pytest.mark.slow
@pytest.mark.parametrize("smoothing", [0.0, 0.1])
def test_values_to_the_bit_and_derivatives(throw: Kernel, smoothing: float) -> None:
    z = np.array([4.0, 0.3, 1.0, 0.5, 9.0, 0.1])
    state = throw.forward(z, [smoothing])["state"][0]
    np.testing.assert_array_equal(state, interpret(throw.program, z, [smoothing])["state"])
    jacobian, h = throw.jacobian(z, "state", [smoothing]), 1e-6
    steps = np.vstack([z + h * np.eye(6), z - h * np.eye(6)])
    ahead, behind = np.split(throw.forward(steps, [smoothing])["state"], 2)
    np.testing.assert_allclose(jacobian, (ahead - behind).T / (2 * h), rtol=1e-5, atol=1e-6)
