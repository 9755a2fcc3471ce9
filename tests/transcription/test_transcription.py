"""From a problem file to numbers: objective, residuals, constraints, controls, verdicts; by hand."""

from __future__ import annotations

import numpy as np
import pytest
from tools.repeats import few
from worlds.pushed import PUSHED

from symphys.problem import load_problem
from symphys.trajectory import NotFinite
from symphys.transcription import transcribe
from symphys.transcription.decision_variables import knot_weights


@pytest.fixture(scope="module")
def pushed(tmp_path_factory):
    file = tmp_path_factory.mktemp("pushed") / "pushed.toml"
    file.write_text(PUSHED)
    return transcribe(load_problem(file), backend="casadi")


def motion(mass=2.0):
    """The puck's exact motion under the guess's forces, at the ends of the steps: times, x, vx, y."""
    t = np.linspace(0, 1, 101)
    fx, fy = np.repeat([[1, 3, 5, 7], [2, 4, 6, 8]], 25, axis=1)
    vx = np.concatenate([[0], np.cumsum(fx) * 0.01 / mass])
    vy = np.concatenate([[0], np.cumsum(fy) * 0.01 / mass])
    x = np.concatenate([[0], np.cumsum((vx[:-1] + vx[1:]) / 2 * 0.01)])
    y = np.concatenate([[0], np.cumsum((vy[:-1] + vy[1:]) / 2 * 0.01)])
    return t, x, vx, y


def test_objective_is_the_sum_of_the_file_s_terms(pushed):
    t, x, vx, y = motion()
    effort = 0.5 * 0.25 * sum(a * a for a in range(1, 9))
    path = np.trapezoid(x + t, t)
    place = 3 * ((x[-1] - 1) ** 2 + y[-1] ** 2)
    z = pushed.shooting.start(0)
    merit, objective, errors, _ = (np.array(part).ravel() for part in pushed.functions.value(z, 0.0))
    assert objective[0] == pytest.approx(effort + path + place, rel=1e-12)
    over = np.maximum(vx[1:] - 1.5, 0)
    assert merit[0] == pytest.approx(objective[0] + 7 * 0.01 * (over**2).sum(), rel=1e-12)
    assert errors == pytest.approx([np.hypot(x[-1] - 1, y[-1]) / 0.1, over.max() / 0.01], rel=1e-9)


def test_gradient_agrees_with_differences_of_the_value(pushed):
    z = pushed.shooting.start(0)
    slope = np.array(pushed.functions.gradient(z, 0.0)[3]).ravel()

    def merit(at):
        return float(pushed.functions.value(at, 0.0)[0])

    differences = [(merit(z + 1e-5 * e) - merit(z - 1e-5 * e)) / 2e-5 for e in np.eye(z.size)]
    assert slope == pytest.approx(differences, rel=1e-6)
    assert np.abs(slope).min() > 1e-3


def test_a_cost_that_is_no_square_has_no_residuals(pushed):
    assert not pushed.shooting.squares
    assert pushed.functions.residuals is None
    assert pushed.functions.jacobian is None


def test_residuals_square_to_the_merit(tmp_path):
    file = tmp_path / "squares.toml"
    file.write_text(PUSHED.replace('value = "puck.position[0] + time"', 'squares = "puck.position[0] + time"'))
    squares = transcribe(load_problem(file), backend="casadi")
    shooting = squares.functions
    z = squares.shooting.start(0)
    r, _, _, jacobian, _ = (np.array(part) for part in shooting.jacobian(z, 0.0))
    merit, _, _, slope, _ = (np.array(part).ravel() for part in shooting.gradient(z, 0.0))
    assert (r**2).sum() == pytest.approx(merit[0], rel=1e-12)
    assert 2 * jacobian.T @ r.ravel() == pytest.approx(slope, rel=1e-9)


def test_constraints_reach_nlp_solvers_step_by_step(pushed):
    _, _, vx, _ = motion()
    _, values = pushed.functions.nlp(pushed.shooting.start(0), 0.0)
    assert np.array(values).ravel() == pytest.approx(vx[1:], abs=1e-12)
    assert pushed.shooting.constraint_names == ("speed",) * 100
    assert np.isneginf(pushed.shooting.constraint_lower).all()
    assert (pushed.shooting.constraint_upper == 1.5).all()


@few("backend", ["casadi", "auto"], 1)
def test_every_evaluation_has_a_price(tmp_path, backend):
    """Also the Jacobian of constraints, where a cost is no sum of squares."""
    file = tmp_path / "priced.toml"
    file.write_text(PUSHED)
    price = transcribe(load_problem(file), backend=backend).prices(("gradient", "jacobian", "hessian"))
    assert set(price) == {"gradient", "jacobian", "hessian"}
    assert all(each > 0 for each in price.values())


def test_verdict_names_every_check(pushed):
    verdict = pushed.judge(pushed.shooting.start(0))
    assert [(check.kind, check.name, check.met) for check in verdict.checks] == [
        ("target", "place", False),
        ("constraint", "speed", False),
    ]
    assert set(verdict.costs) == {"effort", "path"}
    assert not verdict.solved
    assert verdict.worst == pytest.approx(max(check.error / check.tolerance for check in verdict.checks))


def test_parameters_and_inputs_enter_the_simulation(pushed):
    z = pushed.shooting.from_blocks({"push": np.ones((2, 4)), "mass": np.array([[4.0]])})
    recorded = pushed.simulate(z)
    assert recorded.position[-1, 0] == pytest.approx([1 / 8, 1 / 8, 0], abs=1e-12)
    assert recorded.force[:, 0] == pytest.approx(np.tile([1, 1, 0], (100, 1)))
    assert recorded.time[-1] == pytest.approx(1.0)


def test_a_simulation_that_is_not_finite_names_step_and_body(pushed):
    z = pushed.shooting.from_blocks({"push": np.full((2, 4), 1e308), "mass": np.array([[1e-300]])})
    with pytest.raises(NotFinite, match=r"step 1 .*'puck'"):
        pushed.simulate(z)


def test_seed_zero_is_the_guess_and_others_stay_in_bounds(tmp_path):
    file = tmp_path / "bounded.toml"
    file.write_text(PUSHED.replace("guess = 2.0", "guess = 2.0\nlower = 1.9\nupper = 2.1\nspread = 5.0"))
    shooting = transcribe(load_problem(file), backend="casadi").shooting
    assert (shooting.start(0) == shooting.stacked("guess")).all()
    assert (shooting.start(3) == shooting.start(3)).all()
    assert shooting.start(3)[-1] in (1.9, 2.1) or 1.9 <= shooting.start(3)[-1] <= 2.1
    assert (shooting.start(1) != shooting.start(2)).any()


@pytest.mark.parametrize("steps", [7, 100])
@pytest.mark.parametrize("knots", [1, 2, 3, 7])
def test_knots_are_shared_out_over_the_steps(knots, steps):
    """Shares sum to one; linear knots reproduce a straight line, constant ones equal parts."""
    line = np.linspace(2.0, 5.0, knots) if knots > 1 else np.array([2.0])
    middle = (np.arange(steps) + 0.5) / steps
    for kind in ("constant", "linear"):
        weights = np.array(knot_weights(knots, steps, kind).full())
        assert weights.sum(axis=0) == pytest.approx(np.ones(steps))
    linear = line @ np.array(knot_weights(knots, steps, "linear").full())
    assert linear == pytest.approx(2 + 3 * middle if knots > 1 else np.full(steps, 2.0))
    constant = np.array(knot_weights(knots, steps, "constant").full())
    assert constant.sum(axis=1) == pytest.approx(np.full(knots, steps / knots))
    acting = np.minimum(np.floor(middle * knots).astype(int), knots - 1)
    assert (constant[acting, np.arange(steps)] >= 0.5 - 1e-12).all()


@pytest.mark.parametrize("kind", ["constant", "linear"])
@pytest.mark.parametrize(("knots", "steps"), [(5, 7), (3, 40), (11, 6), (91, 450), (81, 450)])
def test_a_step_has_the_mean_of_its_knots(kind, knots, steps):
    """The impulse of an input is that of its knots, wherever they lie within steps; by samples of the interpolation."""
    values = np.random.default_rng(0).normal(size=knots)
    fine = (np.arange(steps * 2000) + 0.5) / (steps * 2000)
    if kind == "linear":
        sampled = np.interp(fine, np.linspace(0, 1, knots), values)
    else:
        sampled = values[np.floor(fine * knots).astype(int)]
    weights = np.array(knot_weights(knots, steps, kind).full())
    assert values @ weights == pytest.approx(sampled.reshape(steps, -1).mean(axis=1), abs=3e-3)
    coarse = np.array(knot_weights(knots, 2 * steps, kind).full())
    assert weights == pytest.approx(coarse.reshape(knots, steps, 2).mean(axis=2), abs=1e-12)
