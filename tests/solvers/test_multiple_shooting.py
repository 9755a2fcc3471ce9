"""Multiple shooting: its slopes are those of differences, its answers stationary, its nodes those of the rollout."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
import scipy.sparse as sp
from staged_toys import Chain, acrobot, attitude, boxed, pendulum
from toys import quadratic, stop_at, through_json

from symphys.errors import SymphysError
from symphys.shooting import ShootingProblem
from symphys.solvers import SOLVERS, MultipleShootingOptions, Outcome, Status
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.point import Incumbent
from symphys.solvers.methods.multiple_shooting import DEFECT
from symphys.solvers.multiple_shooting.chart import curved_columns, interpolated
from symphys.solvers.multiple_shooting.grid import make_grid
from symphys.solvers.multiple_shooting.nlp import MultipleShootingNlp
from symphys.solvers.multiple_shooting.programs import Programs
from symphys.solvers.multiple_shooting.shots import IntervalSteps

SWING = 98.637754
"""The least objective of the acrobot's swing-up that is known."""
LINE = ((0.0, 0.0, 0.0, 0.0), (np.pi, 0.0, 0.0, 0.0))
WAYS = [("ipopt", "gauss-newton"), ("ipopt", "exact"), ("fatrop", "gauss-newton"), ("fatrop", "exact")]
every_way = pytest.mark.parametrize(("backend", "hessian"), WAYS)
robust = pytest.mark.parametrize(("backend", "hessian"), [way for way in WAYS if way != ("fatrop", "gauss-newton")])
"""FATROP may stall where limits are active and the Hessian lacks curvature."""
every_backend = pytest.mark.parametrize("backend", ["ipopt", "fatrop"])


def solve(problem: ShootingProblem, start: Any = None, **options: Any) -> Outcome:
    """The rest of the arguments of a solve are among the options."""
    more = {name: options.pop(name) for name in ("monitor", "checkpoint", "keep", "log") if name in options}
    z = problem.start(0) if start is None else start
    return SOLVERS["multiple_shooting"].solve(problem, z, MultipleShootingOptions(**options), **more)


def program(problem: ShootingProblem, z: Any, nodes: Any = None, **options: Any) -> MultipleShootingNlp:
    """The nonlinear program with references at the rollout of z, or at given nodes."""
    assert problem.staged is not None
    chain = problem.staged()
    evaluator = CountingEvaluator(problem, 0.0, Incumbent(stop_when_met=False))
    chosen = MultipleShootingOptions(**options)
    grid = make_grid(chain, chosen.steps_between_nodes)
    nodes = chain.roll_out(z, 0.0).x[grid.starts[1:]] if nodes is None else nodes
    return Programs(chain, grid, evaluator, z, nodes, chosen.backend == "fatrop", chosen.hessian == "exact").at(nodes)


def defect(found: Outcome) -> float:
    """Of the last iterate."""
    return found.trace[-1].outputs[DEFECT]


SLOPED: dict[str, tuple[Chain, int, tuple[float, ...]]] = {
    "pendulum": (pendulum(knots=9, fast=8.0, throw=True), 6, (0.5,)),
    "acrobot": (acrobot(steps=12), 5, ()),
    "attitude": (attitude(steps=9, parameter=True), 4, (1.3,)),
}


@pytest.mark.parametrize("name", SLOPED)
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


@pytest.mark.parametrize(
    ("backend", "hessian", "every"), [(*way, every) for way, every in zip(WAYS, (1, 4, 4, 1), strict=True)]
)
def test_acrobot_swings_up_from_a_straight_line(backend: str, hessian: str, every: int) -> None:
    """Hanging to upright through states that no motion has, without a guess of the controls."""
    problem = boxed(acrobot())
    found = solve(problem, backend=backend, hessian=hessian, nodes=LINE, steps_between_nodes=every)
    assert found.status is Status.CONVERGED
    assert found.trace[0].objective > 300
    assert found.trace[-1].best == pytest.approx(SWING, abs=1e-4)
    assert defect(found) < 1e-6
    assert problem.staged is not None
    last = problem.staged().roll_out(found.z, 0.0).x[-1]
    assert last == pytest.approx([np.pi, 0, 0, 0], abs=0.5)


@every_way
def test_a_body_turns_by_180_degrees(backend: str, hessian: str) -> None:
    """And by 60 about another axis: tangents turn far, so the nodes get new references."""
    lines: list[str] = []
    problem = boxed(attitude())
    found = solve(problem, backend=backend, hessian=hessian, log=lines.append)
    assert found.status is Status.CONVERGED
    assert found.trace[-1].best == pytest.approx(22.467749, abs=1e-4)
    assert any("new references" in line for line in lines)
    assert problem.staged is not None
    assert np.linalg.norm(problem.staged().roll_out(found.z, 0.0).x[:, :4], axis=1) == pytest.approx(1)


@every_backend
def test_a_free_parameter_of_all_steps(backend: str) -> None:
    """The scale of the inertia: static entries act in every interval."""
    problem = boxed(attitude(parameter=True), statics=[1.2])
    found = solve(problem, backend=backend, steps_between_nodes=3)
    assert found.status is Status.CONVERGED
    assert found.trace[-1].best == pytest.approx(14.742314, abs=1e-4)
    assert found.z[-1] < 1.2


@robust
def test_a_free_initial_speed(backend: str, hessian: str) -> None:
    """A torque too weak to lift the pendulum: it is thrown."""
    found = solve(boxed(pendulum(throw=True), 3.0, statics=[1.0]), backend=backend, hessian=hessian)
    assert found.status is Status.CONVERGED
    assert found.trace[-1].objective == pytest.approx(4.797, abs=1e-3)
    assert abs(found.z[-1]) > 3


@robust
def test_limits_of_controls_and_of_the_path(backend: str, hessian: str) -> None:
    """Some controls are at their bounds and some speeds at their limit, and none beyond; the end is met."""
    chain = pendulum(fast=4.0, knots=11)
    problem = boxed(chain, 8.0)
    found = solve(problem, backend=backend, hessian=hessian, steps_between_nodes=4, tolerance=1e-8)
    assert found.status is Status.CONVERGED
    motion = chain.roll_out(found.z, 0.0)
    assert np.abs(found.z).max() == pytest.approx(8.0, abs=1e-5) and np.abs(found.z).max() <= 8.0
    assert np.abs(motion.x[:-1, 1]).max() == pytest.approx(4.0, abs=1e-5)
    assert motion.x[-1, 0] == pytest.approx(np.pi, abs=1e-6)
    assert found.trace[-1].max_violation < 1


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


@pytest.mark.parametrize("stop", [0, 7, 25])
@every_backend
def test_what_was_interrupted_comes_to_the_same_answer(backend: str, stop: int) -> None:
    """Through the checkpoint's nodes: the rollout of its z alone is not where the solve was."""
    problem = boxed(acrobot())
    options: dict[str, Any] = {"nodes": LINE, "backend": backend}
    part = solve(problem, **options, monitor=stop_at(stop))
    assert part.status is Status.INTERRUPTED and len(part.trace) == stop + 1
    rest = solve(problem, **options, checkpoint=through_json(part.checkpoint))
    assert rest.status is Status.CONVERGED
    assert rest.trace[-1].best == pytest.approx(SWING, abs=1e-4)
    assert [row.iteration for row in rest.trace] == list(range(len(rest.trace)))
    assert repr(rest.trace[: stop + 1]) == repr(part.trace)


def test_multipliers_of_a_checkpoint_shorten_the_rest() -> None:
    """Interrupted near the end it goes on near the end."""
    problem = boxed(pendulum(fast=4.0), 8.0)
    whole = solve(problem)
    part = solve(problem, monitor=stop_at(len(whole.trace) - 4))
    rest = solve(problem, checkpoint=through_json(part.checkpoint))
    assert rest.status is Status.CONVERGED
    assert rest.z == pytest.approx(whole.z, abs=1e-3)
    assert len(rest.trace) < len(whole.trace) + 8


@every_backend
@pytest.mark.parametrize("kind", ["step", "linearize", "expand"])
@pytest.mark.parametrize("error", [KeyboardInterrupt(), RuntimeError("out of order"), MemoryError("72 TiB")])
def test_what_an_evaluation_raises(backend: str, kind: str, error: BaseException, monkeypatch: Any) -> None:
    """An interruption goes on from the last iterate, all else is a failure; neither is lost in the library."""
    chain = acrobot()
    whole, count = getattr(chain, kind), [0]
    last = 10 if kind != "step" else 10 * chain.steps

    def failing(*given: Any) -> Any:
        count[0] += 1
        if count[0] == last:
            raise error
        return whole(*given)

    monkeypatch.setattr(chain, kind, failing)
    problem = boxed(chain)
    found = solve(problem, nodes=LINE, backend=backend)
    if isinstance(error, KeyboardInterrupt):
        assert found.status is Status.INTERRUPTED
        rest = solve(problem, nodes=LINE, backend=backend, checkpoint=through_json(found.checkpoint))
        assert rest.trace[-1].best == pytest.approx(SWING, abs=1e-4)
    else:
        assert found.status is Status.FAILED and str(error) in found.advice


def test_a_motion_on_another_grid_is_a_guess() -> None:
    """Twice as many steps, from the nodes and controls of few: fewer iterations than from the line."""
    coarse, fine = acrobot(20, 0.1), boxed(acrobot())
    found = solve(boxed(coarse), nodes=LINE)
    motion = coarse.roll_out(found.z, 0.0)
    guess = tuple(tuple(row) for row in motion.x.tolist())
    again = solve(fine, np.repeat(found.z, 2), nodes=guess)
    assert again.trace[-1].best == pytest.approx(SWING, abs=1e-4)
    assert len(again.trace) < len(solve(fine, nodes=LINE).trace)


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


def test_what_no_step_depends_on_stays() -> None:
    """A knot without weight keeps its guess."""
    chain = pendulum(knots=11)
    weights = chain.weights.toarray()
    chain.weights = sp.csr_array(np.hstack([weights, np.zeros((len(weights), 1))]))
    for backend in ("ipopt", "fatrop"):
        found = solve(boxed(chain, 8.0, guess=0.25), backend=backend, steps_between_nodes=4)
        assert found.status is Status.CONVERGED and found.z[-1] == 0.25


@every_backend
def test_it_is_silent_and_counts(backend: str, capfd: pytest.CaptureFixture[str]) -> None:
    problem = boxed(pendulum(), 8.0)
    lines: list[str] = []
    found = solve(problem, backend=backend, log=lines.append)
    assert capfd.readouterr() == ("", "")
    assert found.counts.rollouts > len(found.trace) and found.counts.jacobians >= len(found.trace) - 1
    assert any("intervals of 1 steps, defects up to" in line for line in lines)
    assert all(DEFECT in row.outputs for row in found.trace)


def test_a_start_that_is_not_finite() -> None:
    found = solve(boxed(pendulum(), guess=np.nan))
    assert found.status is Status.NOT_FINITE and "start" in found.advice


def fragile(chain: Chain) -> tuple[Chain, list[int]]:
    """With steps that are not finite beyond a speed of 25 rad/s, and how many of these each call made."""
    whole, seen = chain.step, []

    def step(k: int, X: Any, U: Any, Z: Any, smoothing: float) -> Any:
        wild = ~(np.abs(X[:, 2:]).max(axis=1) < 25)
        seen.append(int(wild.sum()))
        return np.where(wild[:, None], np.nan, whole(k, X, U, Z, smoothing))

    chain.step = step  # type: ignore[method-assign]
    return chain, seen


@every_backend
@pytest.mark.parametrize("at", [1, 4])
def test_slopes_that_are_not_finite(backend: str, at: int, monkeypatch: Any) -> None:
    chain = acrobot()
    whole, count = chain.linearize, [0]

    def spoiled(motion: Any) -> Any:
        count[0] += 1
        found = whole(motion)
        return replace(found, a=found.a * np.nan) if count[0] >= at else found

    monkeypatch.setattr(chain, "linearize", spoiled)
    found = solve(boxed(chain), nodes=LINE, backend=backend)
    assert found.status is Status.NOT_FINITE and "derivative" in found.advice


@every_backend
def test_simulations_that_are_not_finite_shorten_the_step(backend: str) -> None:
    chain, seen = fragile(acrobot())
    found = solve(boxed(chain), backend=backend, nodes=LINE, steps_between_nodes=4)
    assert sum(seen) > 0
    assert found.trace[-1].best == pytest.approx(SWING, abs=1e-3)


@every_backend
def test_a_guess_of_states_makes_up_for_controls_that_cannot_be_simulated(backend: str) -> None:
    problem = boxed(fragile(acrobot())[0], guess=50.0)
    assert solve(problem, backend=backend).status is Status.NOT_FINITE
    found = solve(problem, backend=backend, nodes=LINE)
    assert found.status is Status.CONVERGED and not np.isfinite(found.trace[0].objective)
    assert found.trace[-1].best == pytest.approx(SWING, abs=1e-4)


@every_backend
def test_it_stops_where_all_is_met(backend: str) -> None:
    """At the first iterate whose rollout meets the end, if the problem asks for no more."""
    problem = replace(boxed(pendulum(), 8.0), stop_when_met=True)
    found = solve(problem, backend=backend)
    assert found.status is Status.MET
    assert all(row.max_violation > 1 for row in found.trace[:-1])
    assert len(found.trace) < len(solve(boxed(pendulum(), 8.0), backend=backend).trace)


@every_backend
def test_a_budget(backend: str) -> None:
    found = solve(boxed(acrobot()), backend=backend, nodes=LINE, iterations=5)
    assert found.status is Status.BUDGET and "iterations" in found.advice
    assert len(found.trace) == 6


def test_a_problem_without_steps_is_refused() -> None:
    found = SOLVERS["multiple_shooting"].solve(quadratic(), np.zeros(3), MultipleShootingOptions())
    assert found.status is Status.NOT_APPLICABLE
    assert "step by step" in found.advice and "ipopt" in found.advice


def test_fatrop_takes_no_constraint_across_intervals() -> None:
    """IPOPT does: the sum of two speeds far apart."""
    chain = pendulum(fast=50.0)
    slopes = chain.limit_slopes

    def across(motion: Any) -> Any:
        limits, by_state, by_input, by_static = slopes(motion)
        both = by_state.tolil()
        both[0, 60] = 1e-9
        return limits, both.tocsr(), by_input, by_static

    chain.limit_slopes = across  # type: ignore[method-assign]
    assert solve(boxed(chain, 8.0)).status is Status.CONVERGED
    with pytest.raises(SymphysError, match=r"number 1 depends on several: use backend = 'ipopt'"):
        solve(boxed(chain, 8.0), backend="fatrop")


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"backend": "snopt"}, "backend must be ipopt or fatrop"),
        ({"hessian": "none"}, "hessian must be gauss-newton, exact or limited-memory"),
        ({"hessian": "limited-memory", "backend": "fatrop"}, "hessian must be gauss-newton or exact with"),
        ({"nodes": ((0.0, 1.0),)}, "nodes must be two states or more"),
        ({"steps_between_nodes": -1}, "steps_between_nodes must be at least 0"),
        ({"tolerance": 0.0}, "tolerance must be above 0"),
    ],
)
def test_values_that_cannot_be(bad: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        MultipleShootingOptions(**bad)


def test_what_cannot_be_passed_on() -> None:
    problem = boxed(pendulum(), 8.0)
    for options, message in (
        ({"options": {"nonsense": 1}}, "options.nonsense: .*no such option"),
        ({"options": {"max_iter": 1}}, "options.max_iter: .*use iterations"),
        ({"nodes": ((0.0,), (1.0,))}, "nodes: a state of this problem has 2 numbers, not 1"),
    ):
        with pytest.raises(SymphysError, match=f"solver.multiple_shooting.{message}"):
            solve(problem, **options)


def test_a_checkpoint_of_another_grid_is_damaged() -> None:
    problem = boxed(pendulum(), 8.0)
    part = solve(problem, monitor=stop_at(3))
    with pytest.raises(SymphysError, match="damaged"):
        solve(problem, steps_between_nodes=5, checkpoint=through_json(part.checkpoint))
