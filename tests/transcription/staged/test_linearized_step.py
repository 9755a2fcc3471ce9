"""Slopes of steps, multiplied along a motion, are the adjoint of its rollout."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import casadi as ca
import numpy as np
import pytest
from tools.repeats import thorough
from worlds.driven import TABLES
from worlds.staged_worlds import problem_of

import symphys
from symphys.codegen import KernelUnavailable
from symphys.problem import Problem
from symphys.transcription.rollout import Rollout, symbolic_rollout
from symphys.transcription.staged import linearized_step
from symphys.transcription.staged.linearization import Linearization

pytestmark = pytest.mark.slow

KERNELS = ("leg", *map(thorough, ("loop", "soft", "hopper_jump")))


def guess_of(problem: Problem) -> np.ndarray:
    """(n,) the decision vector at which slopes are compared."""
    return np.concatenate([np.zeros(0), *(variable.guess for variable in problem.variables)])


def adjoint_of(rollout: Rollout, z: np.ndarray, weights: np.ndarray, smoothing: float) -> np.ndarray:
    """(n,) of weights . the last state, by casadi's reverse mode on the whole rollout."""
    slope = ca.jtimes(rollout.x[:, -1], rollout.z, ca.DM(weights), True)
    return np.array(ca.Function("adjoint", [rollout.z, rollout.smoothing], [slope])(z, smoothing)).ravel()


def chained(made: Linearization, z: np.ndarray, weights: np.ndarray, smoothing: float) -> np.ndarray:
    """(n,) the same from the slopes of the steps."""
    motion = made.motion(z, smoothing)
    slopes = made.linearize(motion)
    p = made.start(z)[2]
    basis, moved = (np.array(ca.DM(each(motion.x[-1], p))) for each in (made.tangent.basis, made.tangent.shift))
    adjoint, inputs = basis.T @ weights, np.zeros_like(motion.u)
    statics = np.array(ca.DM(made._start_slopes(z)[1])).T @ moved.T @ weights
    for k in reversed(range(len(slopes.a))):
        inputs[k] = slopes.b[k].T @ adjoint
        statics += slopes.c[k].T @ adjoint
        adjoint = slopes.a[k].T @ adjoint
    given, variables = made.rollout.given, made.rollout.z
    weights_of = np.array(ca.DM(ca.Function("weights", [variables], [ca.jacobian(ca.vec(given), variables)])(z)))
    found = weights_of.T @ inputs.ravel()
    found[made.statics] += statics + slopes.start.T @ adjoint
    return np.asarray(found)


@cache
def compiled(name: str, threads: int = 1) -> Linearization:
    """By kernels, whose plans take seconds; tests share them."""
    with TemporaryDirectory() as folder:
        return Linearization(symbolic_rollout(problem_of(name, Path(folder))), "auto", threads)


def off_by(problem: Problem, backend: str, smoothing: float = 0.0) -> float:
    """How far chained slopes are from the adjoint, as a share of it."""
    return apart(Linearization(symbolic_rollout(problem), backend, 1), smoothing)


def apart(made: Linearization, smoothing: float = 0.0) -> float:
    """See ``off_by``."""
    rollout, z = made.rollout, guess_of(made.rollout.problem)
    weights = np.random.default_rng(0).normal(size=rollout.memory.size)
    aim = adjoint_of(rollout, z, weights, smoothing)
    return float(np.abs(chained(made, z, weights, smoothing) - aim).max() / np.abs(aim).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", [thorough(name) if name == "leg" else name for name in KERNELS])
def test_chained_slopes_are_the_adjoint(name: str) -> None:
    """In ``leg`` a parameter moves a joint, and with it the first state."""
    assert apart(compiled(name)) < 1e-10


@pytest.mark.parametrize("name", ["ball_throw", thorough("soft"), thorough("leg")])
def test_so_they_are_on_the_virtual_machine(name: str, tmp_path: Path) -> None:
    """In ``soft`` a variable sets the velocity of one body, and impacts cut steps."""
    assert off_by(problem_of(name, tmp_path), "casadi", 0.01) < 1e-10


@pytest.mark.slow
def test_controllers_are_part_of_the_step() -> None:
    assert off_by(symphys.load(TABLES), "casadi") < 1e-10


@pytest.mark.slow
def test_a_start_beside_the_tangent_counts(tmp_path: Path) -> None:
    """The velocity of one body of a robot alone breaks its joints, and yet its slope is exact."""
    problem = problem_of(
        "loop", tmp_path, more='[[variable]]\nname = "blow"\nsets = "rod.velocity"\nguess = [0.1, 0, 0.3]'
    )
    assert off_by(problem, "casadi") < 1e-10


def test_without_a_compiler_casadi_evaluates(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object, **more: object) -> None:
        raise KernelUnavailable("there is no compiler")

    monkeypatch.setattr(linearized_step, "compile_slopes", refuse)
    made = Linearization(symbolic_rollout(problem_of("ball_throw", tmp_path)))
    assert "there is no compiler" in made.step.description


def test_steps_are_those_of_the_rollout_to_the_bit() -> None:
    made = compiled("leg")
    rollout, z = made.rollout, guess_of(made.rollout.problem)
    states = ca.Function("states", [rollout.z, rollout.smoothing], [rollout.x])(z, 0.0)
    motion = made.motion(z, 0.0)
    assert np.array_equal(motion.x, np.array(states).T)


def test_small_batches_are_prepared_once_and_differences_compiled() -> None:
    """Rows of small batches, again and again with other numbers, are those of large ones, and differences are right."""
    made = compiled("leg")
    motion = made.motion(guess_of(made.rollout.problem), 0.0)
    _, u, p = made.start(motion.z)
    large = made.step.step(np.arange(len(u)), motion.x[:-1], u, p, 0.0)
    assert len(u) > linearized_step.MAX_LENT_ROWS
    for first in (0, 3, 9):
        few = slice(first, first + 4)
        found = made.step.step(np.arange(first, first + 4), motion.x[few], u[few], p, 0.0)
        np.testing.assert_array_equal(found, large[few])
        found = made.step.difference(motion.x[few], motion.x[few][::-1])
        wanted = made.tangent.difference(motion.x[few], motion.x[few][::-1])
        np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)


@pytest.mark.slow
def test_states_and_threads_do_not_change_each_others_numbers() -> None:
    made = [compiled("ball_throw", threads) for threads in (1, 2)]
    motion = made[0].motion(guess_of(made[0].rollout.problem), 0.0)
    one, two = (each.linearize(motion) for each in made)
    assert np.array_equal(one.a, two.a) and np.array_equal(one.b, two.b)
    _, u, p = made[0].start(motion.z)
    few, _, _ = made[0].step.slopes(motion.x[:3], u[:3], p, 0.0)
    assert np.array_equal(few, one.a[:3])


def test_what_is_not_finite_stays_so() -> None:
    made = compiled("leg")
    motion = made.motion(guess_of(made.rollout.problem), 0.0)
    motion.x[1, 0] = np.nan
    found = made.linearize(motion).a
    assert np.isnan(found[1]).any() and np.isfinite(found[0]).all() and np.isfinite(found[2:]).all()
