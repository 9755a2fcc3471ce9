"""Multiple shooting comes to the known answers of its toys, by either library, and goes on where it was interrupted."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
import scipy.sparse as sp
from tools.repeats import few
from worlds.shots_of_toys import LINE, SWING, WAYS, defect, every_backend, every_way, program, solve
from worlds.staged_toys import Chain, acrobot, attitude, boxed, pendulum
from worlds.toys import stop_at, through_json

from symphys.solvers import Status
from symphys.solvers.methods.multiple_shooting import DEFECT
from symphys.solvers.multiple_shooting.nlp import fitted


@pytest.mark.slow
@few(("backend", "hessian", "every"), [(*way, every) for way, every in zip(WAYS, (1, 4, 4, 1), strict=True)], 1)
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


@pytest.mark.slow
@every_backend
def test_angles_that_are_known_but_for_whole_turns(backend: str) -> None:
    """Nodes turn by more than half a turn from their references, and the defects do not jump there."""

    def within_half_a_turn(x: Any, y: Any) -> Any:
        off = y - x
        return ca.vertcat(ca.atan2(ca.sin(off[:2]), ca.cos(off[:2])), off[2:])

    plain = acrobot()
    chains = plain, Chain(replace(plain.formulas, difference=within_half_a_turn), plain.steps, plain.steps)
    known, wrapped = (solve(boxed(chain), backend=backend) for chain in chains)
    assert wrapped.status is Status.CONVERGED
    assert wrapped.z == pytest.approx(known.z, abs=1e-3)
    assert len(wrapped.trace) == len(known.trace)


@pytest.mark.slow
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


@pytest.mark.slow
@every_backend
def test_a_free_parameter_of_all_steps(backend: str) -> None:
    """The scale of the inertia: static entries act in every interval."""
    problem = boxed(attitude(parameter=True), statics=[1.2])
    found = solve(problem, backend=backend, steps_between_nodes=3)
    assert found.status is Status.CONVERGED
    assert found.trace[-1].best == pytest.approx(14.742314, abs=1e-4)
    assert found.z[-1] < 1.2


@pytest.mark.slow
@every_way
def test_a_free_initial_speed(backend: str, hessian: str) -> None:
    """A torque too weak to lift the pendulum: it is thrown."""
    found = solve(boxed(pendulum(throw=True), 3.0, statics=[1.0]), backend=backend, hessian=hessian)
    assert found.status is Status.CONVERGED
    assert found.trace[-1].objective == pytest.approx(4.797, abs=1e-3)
    assert abs(found.z[-1]) > 3


@every_way
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


@few("stop", [0, 7, 25], 1)
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


@pytest.mark.slow
def test_multipliers_of_a_checkpoint_shorten_the_rest() -> None:
    """Interrupted near the end it goes on near the end."""
    problem = boxed(pendulum(fast=4.0), 8.0)
    whole = solve(problem)
    part = solve(problem, monitor=stop_at(len(whole.trace) - 4))
    rest = solve(problem, checkpoint=through_json(part.checkpoint))
    assert rest.status is Status.CONVERGED
    assert rest.z == pytest.approx(whole.z, abs=1e-3)
    assert len(rest.trace) < len(whole.trace) + 8


@pytest.mark.slow
@every_backend
@few("first", ["ipopt", "fatrop"], 1)
def test_multipliers_of_a_solution_shorten_a_solve_from_there(first: str, backend: str) -> None:
    """Of limits that bind; whichever library found them. Twice as many steps between the same nodes take them too."""
    chain = pendulum(fast=4.0, knots=11)
    problem = boxed(chain, 8.0)
    found = solve(problem, backend=first)
    there = replace(problem, guessed_states=lambda z, ticks, smoothing: chain.roll_out(found.z, 0.0).x[ticks])
    known = replace(there, multipliers=found.multipliers)
    cold, warm = (solve(each, found.z, backend=backend) for each in (there, known))
    assert warm.status is Status.CONVERGED
    assert warm.z == pytest.approx(found.z, abs=1e-2)
    assert len(warm.trace) <= len(cold.trace) // 2
    fine = boxed(pendulum(80, 0.025, knots=11, fast=4.0), 8.0)
    lines: list[str] = []
    solve(replace(fine, multipliers=found.multipliers), backend=backend, iterations=1, log=lines.append)
    assert any("none fit" in line for line in lines)  # there are more limits


def test_multipliers_are_those_of_the_program() -> None:
    """The slope of the Lagrangian by z is zero where they hold, and so are their products with what has room."""
    problem = boxed(pendulum(fast=4.0, knots=11), 8.0)
    found = solve(problem, tolerance=1e-9)
    assert problem.staged is not None
    nlp = program(problem, found.z)
    known = fitted(nlp, found.multipliers)
    assert known is not None
    w = nlp.pack(found.z, np.zeros(nlp.layout.nodes.shape))
    slopes = ca.DM(nlp.jacobian_pattern.sparsity, nlp.jacobian(w))
    residual = nlp.gradient(w) + (slopes.T @ known.rows).full().ravel() + known.bounds
    assert np.abs(residual).max() < 1e-4 * np.abs(nlp.gradient(w)).max()  # z's rollout is off the nodes
    assert np.abs(known.bounds).max() > 0.05 and np.abs(known.bounds[np.abs(w) < 7]).max(initial=0.0) < 1e-6


@pytest.mark.slow
def test_a_motion_on_another_grid_is_a_guess() -> None:
    """Twice as many steps, from the nodes and controls of few: fewer iterations than from the line."""
    coarse, fine = acrobot(20, 0.1), boxed(acrobot())
    found = solve(boxed(coarse), nodes=LINE)
    motion = coarse.roll_out(found.z, 0.0)
    guess = tuple(tuple(row) for row in motion.x.tolist())
    again = solve(fine, np.repeat(found.z, 2), nodes=guess)
    assert again.trace[-1].best == pytest.approx(SWING, abs=1e-4)
    assert len(again.trace) < len(solve(fine, nodes=LINE).trace)


@pytest.mark.slow
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
    assert found.counts.rollouts > len(found.trace) and found.counts.gradients >= 2 * (len(found.trace) - 1)
    assert any("intervals of 1 steps, defects up to" in line for line in lines)
    assert all(DEFECT in row.outputs for row in found.trace)


@pytest.mark.slow
@every_backend
def test_it_stops_where_all_is_met(backend: str) -> None:
    """At the first iterate whose rollout meets the end, if the problem asks for no more."""
    problem = replace(boxed(pendulum(), 8.0), stop_when_met=True)
    found = solve(problem, backend=backend)
    assert found.status is Status.MET
    assert all(row.max_violation > 1 for row in found.trace[:-1])
    assert len(found.trace) < len(solve(boxed(pendulum(), 8.0), backend=backend).trace)
