"""The nonlinear program of multiple shooting: its slopes are those of differences, its solution stationary."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few
from worlds.shots_of_toys import every_backend, program, solve
from worlds.staged_toys import Chain, acrobot, attitude, boxed, pendulum

from symphys.solvers.multiple_shooting.chart import curved_columns, interpolated
from symphys.solvers.multiple_shooting.shots import IntervalSteps

SLOPED: dict[str, tuple[Chain, int, tuple[float, ...]]] = {
    "pendulum": (pendulum(knots=9, fast=8.0, throw=True), 6, (0.5,)),
    "acrobot": (acrobot(steps=12), 5, ()),
    "attitude": (attitude(steps=9, parameter=True), 4, (1.3,)),
}


@few("name", SLOPED, 1)
@every_backend
def test_slopes_are_those_of_differences(name: str, backend: str) -> None:
    """Of objective, constraints and the Lagrangian's gradient, away from the references, in both layouts."""
    chain, every, statics = SLOPED[name]
    rng = np.random.default_rng(0)
    z = np.concatenate([0.3 * rng.standard_normal(chain.weights.shape[1] - len(statics)), statics])
    problem = boxed(chain, statics=statics)
    problem = replace(problem, blocks=(replace(problem.blocks[0], scale=rng.uniform(0.5, 2, len(z))),))
    nlp = program(problem, z, steps_between_nodes=every, backend=backend, hessian="exact")
    d = 0.3 * rng.standard_normal(nlp.layout.nodes.shape)
    w, duals, h = nlp.pack(z, d), rng.standard_normal(nlp.layout.rows), 1e-5
    # copies move with what they are copies of
    moves = [nlp.pack(each, 0 * d) for each in np.eye(len(z))]
    moves += [nlp.pack(0 * z, each.reshape(d.shape)) for each in np.eye(d.size)]

    def jacobian(at: Any) -> Any:
        return ca.DM(nlp.jacobian_pattern.sparsity, nlp.jacobian(at)).full()

    def lagrangian(at: Any) -> Any:
        return 0.7 * nlp.gradient(at) + jacobian(at).T @ duals

    def slope(function: Any, move: Any) -> Any:
        return (function(w + h * move) - function(w - h * move)) / (2 * h)

    gradient, slopes = nlp.gradient(w).copy(), jacobian(w)
    second = ca.DM(nlp.hessian_pattern.sparsity, nlp.hessian(w, 0.7, duals, False)).full()
    along = np.array(moves)
    for move in moves:
        assert slope(nlp.objective, move) == pytest.approx(gradient @ move, abs=1e-6)
        assert slope(nlp.constraints, move) == pytest.approx(slopes @ move, abs=1e-7)
        assert along @ slope(lagrangian, move) == pytest.approx(along @ second @ move, abs=1e-3)


def test_the_hessian_of_gauss_and_newton_is_twice_that_of_the_residuals() -> None:
    chain, every, statics = SLOPED["attitude"]
    z = np.concatenate([0.3 * np.random.default_rng(1).standard_normal(27), statics])
    nlp = program(boxed(chain, statics=statics), z, steps_between_nodes=every)
    w, h = nlp.pack(z, np.full(nlp.layout.nodes.shape, 0.1)), 1e-5

    def residuals(at: Any) -> Any:
        motion, p = nlp.shots(at).motion, at[chain.statics]
        every_step = [chain.f_r(x, u, p)[0].full() for x, u in zip(motion.x[:-1], motion.u, strict=True)]
        return np.concatenate([*every_step, chain.f_rf(motion.x[-1], p)[0].full()]).ravel()

    assert residuals(w) @ residuals(w) == pytest.approx(nlp.objective(w))
    moves = np.eye(len(w))
    slopes = np.array([(residuals(w + h * move) - residuals(w - h * move)) / (2 * h) for move in moves]).T
    second = ca.DM(nlp.hessian_pattern.sparsity, nlp.hessian(w, 1.0, np.zeros(nlp.layout.rows), False)).full()
    assert second == pytest.approx(2 * slopes.T @ slopes, abs=1e-5)
    upper = ca.DM(nlp.upper_pattern.sparsity, nlp.hessian(w, 1.0, np.zeros(nlp.layout.rows), True)).full()
    assert np.array_equal(upper, np.triu(second))


def test_the_solution_is_stationary_with_its_multipliers() -> None:
    """KKT: the gradient of the Lagrangian vanishes, and multipliers push outwards only where a bound is reached."""
    saved: list[dict[str, Any]] = []
    chain = pendulum(fast=4.0)
    problem = boxed(chain, 8.0)
    solve(problem, tolerance=1e-9, keep=lambda make: saved.append(make()))
    state: Any = saved[-1]["state"]
    z, nodes = np.array(state["z"]), np.array(state["nodes"])
    nlp = program(problem, z, nodes)
    w = nlp.pack(z, np.zeros(nlp.layout.nodes.shape))
    slopes = ca.DM(nlp.jacobian_pattern.sparsity, nlp.jacobian(w)).full()
    bounds, rows = np.array(state["bound_duals"]), np.array(state["row_duals"])
    assert nlp.gradient(w) + slopes.T @ rows + bounds == pytest.approx(np.zeros(len(w)), abs=1e-6)
    low, high = nlp.row_bounds()
    reached = nlp.constraints(w)
    for at, duals, lower, upper in ((reached, rows, low, high), (z, bounds[: len(z)], -8.0, 8.0)):
        assert np.all(duals[(at - lower > 1e-3) & (upper - at > 1e-3)] < 1e-5)
        assert np.all((duals * (at - (np.asarray(lower) + upper) / 2) > -1e-5) | (np.asarray(lower) == upper))
    assert (np.abs(bounds) > 1e-3).sum() > 3


def test_lines_between_states_stay_on_their_manifold() -> None:
    chain = attitude()
    turned = np.array([0.0, 0, 0, 1, 0, 0, 2])
    states = interpolated(chain, np.array([[1.0, 0, 0, 0, 0, 0, 0], turned]), np.array([0.0, 0.5, 1.0]))
    assert np.abs(states[1]) == pytest.approx([np.sqrt(0.5), 0, 0, np.sqrt(0.5), 0, 0, 1])
    assert np.abs(states[2]) == pytest.approx(turned)


def test_only_rotations_are_curved() -> None:
    assert curved_columns(attitude(), attitude().roll_out(np.ones(90), 0.0).x[1:]).tolist() == [0, 1, 2]
    assert curved_columns(acrobot(), acrobot().roll_out(np.ones(40), 0.0).x[1:]).tolist() == []


def test_steps_that_depend_on_time_are_taken_one_by_one() -> None:
    """The batch of one call shares its number of the step."""
    chain = pendulum(steps=6)
    motion = chain.roll_out(np.arange(6.0), 0.0)
    assert IntervalSteps(chain, motion).alike
    same = chain.step

    def gusty(k: int, X: Any, U: Any, Z: Any, smoothing: float) -> Any:
        return same(k, X, U + (k == 4), Z, smoothing)

    chain.step = gusty  # type: ignore[method-assign]
    steps = IntervalSteps(chain, motion)
    assert not steps.alike
    at = np.array([1, 4])
    assert steps(at, motion.x[at], motion.u[at], motion.z, 0.0)[1] == pytest.approx(
        same(4, motion.x[4:5], motion.u[4:5] + 1, motion.z[None], 0.0)[0]
    )
