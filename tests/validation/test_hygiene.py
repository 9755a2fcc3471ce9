"""What any engine owes: true velocities, finite derivatives, right derivatives, the same numbers every time."""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tools.laboratory import Lab, built, central_difference, value_and_gradient
from tools.repeats import few, thorough

from symphys.model.shapes import Plane, Sphere
from symphys.model.state_layout import initial_state
from symphys.model.world import Body, Law, Scheme, make_world

SMOOTHINGS = (0.0, 1e-12, 1e-6, 1e-3, 0.1)
PLACES = {
    "at rest": ([0, 0, 0.2], [0.4, 0, 0.2]),
    "stacked": ([0, 0, 0.2], [0, 0, 0.6]),
    "coincident": ([0, 0, 1], [0, 0, 1]),
    "overlapping": ([0, 0, 0.1], [0.3, 0, 0.1]),
    "free": ([0, 0, 2], [5, 0, 2]),
}
LAWS = {
    "hard": Law(0.5, 0.5),
    "frictionless": Law(0.0, 1.0),
    "plastic": Law(0.5, 0.0),
    "spins": Law(0.5, 0.5, torsion=0.01, rolling=0.01),
    "soft": Law(0.5, 0.0, frequency=5.0),
}
LAWS_BY_TURNS = few("law", [thorough(law) if law in ("frictionless", "plastic") else law for law in LAWS], 1)
"""What is left for ``make thorough`` are special cases of the first."""


def two_balls(law, gravity=(0, 0, -9.81)):
    return make_world([Body.ball("a", 0.2, 1.0), Body.ball("b", 0.2, 1.0)], [Plane.ground()], law, gravity)


def with_derivatives(world):
    """(x, smoothing) -> (x', dx'/d(x, smoothing), second derivatives of a weighted sum of x')."""
    step = built(world, Scheme())
    x, smoothing = ca.SX.sym("x", step.size1_in(0)), ca.SX.sym("s")
    after = step(x, ca.DM(0, 1), ca.DM(0, 1), smoothing)
    at = ca.vertcat(x, smoothing)
    weighted = ca.dot(after, ca.DM(np.linspace(1, 2, after.shape[0])))
    return ca.Function("d", [x, smoothing], [after, ca.jacobian(after, at), ca.hessian(weighted, at)[0]])


@cache
def derivatives_under(law):
    return with_derivatives(two_balls(LAWS[law]))


@cache
def slopes_under(law):
    """(x, smoothing) -> (x', dx'/d(x, smoothing))."""
    step = built(two_balls(LAWS[law]), Scheme())
    x, smoothing = ca.SX.sym("x", step.size1_in(0)), ca.SX.sym("s")
    after = step(x, ca.DM(0, 1), ca.DM(0, 1), smoothing)
    return ca.Function("d", [x, smoothing], [after, ca.jacobian(after, ca.vertcat(x, smoothing))])


@LAWS_BY_TURNS
def test_derivatives_are_finite_in_degenerate_places(law):
    """Rest, exact touch, zero slip, zero rotation, coincident centres; at every smoothing; first and second order."""
    world, derivatives = two_balls(LAWS[law]), derivatives_under(law)
    for place, (a, b) in PLACES.items():
        for smoothing in SMOOTHINGS:
            x = initial_state(world, {"a.position": a, "b.position": b})
            for _ in range(3):
                x, *more = derivatives(x, smoothing)
                assert all(np.isfinite(np.array(part)).all() for part in (x, *more)), (place, smoothing)


@LAWS_BY_TURNS
def test_first_derivatives_stay_moderate_at_rest(law):
    """A body that exactly touches inherits no infinite slope from the time it would take to fall there.

    The steepest slope is natural: an overlap is pushed out within a stretch of dt / 2, with a force of m / (dt / 2)^2
    times it, and a few times that in a stack. Where e = 1 it is a matter of rounding whether the rebound of a resting
    body leaves the surface, and the share that does rises over 1e-4 of a fall within the step.
    """
    derivatives = derivatives_under(law)
    x = initial_state(two_balls(LAWS[law]), {"a.position": [0, 0, 0.2], "b.position": [0, 0, 0.6]})
    for _ in range(3):
        x, slope, _ = derivatives(x, 0.0)
        natural = 20 / (Scheme().dt / 2) ** 2
        assert np.abs(np.array(slope)).max() < (natural if LAWS[law].restitution < 1 else 100 * natural)


number = st.floats(-1, 1)
vector = st.tuples(number, number, number)


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(vector, vector, vector, vector, st.sampled_from(sorted(LAWS)), st.sampled_from(SMOOTHINGS), st.booleans())
@pytest.mark.thorough
def test_random_scenes_are_finite(a, b, va, wa, law, smoothing, snap):
    """Touching, overlapping, aligned, moving: value and slope of five steps."""
    derivatives = slopes_under(law)
    a, b = (np.round(p, 1) if snap else np.array(p) for p in (a, b))
    start = {"a.position": a, "b.position": b, "a.velocity": va, "a.angular_velocity": np.array(wa) * 10}
    x = initial_state(two_balls(LAWS[law]), start)
    for _ in range(5):
        x, slope = derivatives(x, smoothing)
        assert np.isfinite(np.array(x)).all()
        assert np.isfinite(np.array(slope)).all()


@pytest.mark.slow
def test_reported_velocities_are_true():
    """At rest 0 from the first step on; in flight v0 + a t; sliding v0 - mu g t."""
    ball = Lab(two_balls(Law(0.3, 0.0)), Scheme())
    rest = ball.states({"a.position": [0, 0, 0.2], "b.position": [3, 0, 0.2]}, 0.2)
    assert np.abs(rest["a.velocity"]).max() == 0
    assert rest["a-ground.force"][1:, 2] == pytest.approx(np.full(20, 9.81), abs=1e-12)
    t = np.arange(21) * 0.01
    flight = ball.states({"a.position": [0, 0, 5], "a.velocity": [1, 0, 2], "b.position": [3, 0, 0.2]}, 0.2)
    assert flight["a.velocity"][:, 2] == pytest.approx(2 - 9.81 * t, abs=1e-12)
    slide = ball.states({"a.position": [0, 0, 0.2], "a.velocity": [4, 0, 0], "b.position": [9, 0, 0.2]}, 0.2)
    assert slide["a.velocity"][:, 0] == pytest.approx(4 - 0.3 * 9.81 * t, abs=1e-12)


@cache
def random_impact():
    """A function of (z0, vx, vz, spin, mass, radius, mu, e) with two impacts and friction, off every symmetry."""
    m, r, mu, e = (ca.SX.sym(name) for name in ("m", "r", "mu", "e"))
    bodies = [Body.ball("a", r, m), Body("b", 0.7, (0.02, 0.03, 0.04), (Sphere(0.15, (0.1, 0, 0)), Sphere(0.1)))]
    world = make_world(bodies, [Plane.ground()], Law(mu, e))
    lab = Lab(world, Scheme(), parameters=[m, r, mu, e])

    def final(z):
        values = {
            "a.position": ca.vertcat(0, 0, z[0]),
            "a.velocity": ca.vertcat(z[1], 0.13, z[2]),
            "a.angular_velocity": ca.vertcat(1.0, z[3], -2.0),
            "b.position": [0.55, 0.05, 0.45],
            "b.angular_velocity": [0.3, 0.2, 0.1],
        }
        last = lab.trajectory(values, 0.6, p=z[4:8])[:, -1]
        return ca.vertcat(last[lab.layout["a.position"]], last[lab.layout["b.position"]])

    return final


POINT = [0.9, 0.9, -0.4, 3.0, 1.3, 0.21, 0.4, 0.6]


@pytest.mark.thorough
def test_gradients_agree_with_central_differences():
    """Also in mass, radius, friction and restitution, through impacts with friction of a turning compound."""
    final = random_impact()
    _, slope = value_and_gradient(final, POINT)
    reference = central_difference(final, POINT)
    assert np.abs(slope).max(axis=0).min() > 1e-3
    assert slope == pytest.approx(reference, abs=1e-6 * np.abs(reference).max())


@pytest.mark.thorough
def test_the_check_rejects_a_wrong_derivative():
    """The same comparison fails when one path of the derivative is cut."""
    final = random_impact()
    _, slope = value_and_gradient(lambda z: final(ca.vertcat(z[:6], POINT[6], z[7])), POINT)
    reference = central_difference(final, POINT)
    assert slope != pytest.approx(reference, abs=1e-6 * np.abs(reference).max())


@pytest.mark.thorough
def test_forward_results_do_not_depend_on_gradients():
    """Bit-identical values with and without derivatives in the same function, and from call to call."""
    final = random_impact()
    z = ca.MX.sym("z", 8)
    alone = ca.Function("f", [z], [final(z)])
    both = ca.Function("g", [z], [final(z), ca.jacobian(final(z), z)])
    value = np.array(alone(POINT))
    assert (value == np.array(both(POINT)[0])).all()
    assert (value == np.array(alone(POINT))).all()


@few("law", ["hard", "spins", "plastic"], 1)
def test_smoothing_goes_to_the_exact_step(law):
    """The error falls with the smoothing, and smoothing 0 is the limit."""
    lab = Lab(two_balls(LAWS[law]), Scheme())
    start = {"a.position": [0, 0, 0.5], "a.velocity": [1, 0, 0], "b.position": [0.6, 0.1, 0.2]}
    exact = lab.states(start, 0.8)["a.position"][-1]
    errors = [
        np.abs(lab.states(start, 0.8, smoothing=s)["a.position"][-1] - exact).max() for s in (1e-2, 1e-4, 1e-6, 1e-12)
    ]
    assert errors[0] > errors[2]
    assert errors[1] < 1e-3
    assert errors[3] < 1e-6


def test_coordinates_do_not_matter():
    """The same scene turned about z and moved gives the same motion, turned and moved."""
    lab = Lab(two_balls(LAWS["hard"]), Scheme(sweeps=30))
    start = {"a.position": [0, 0, 0.5], "a.velocity": [1, 0.2, 0], "b.position": [0.6, 0.1, 0.2]}
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    away = np.array([3.0, -2.0, 0.0])
    other = {k: turn @ v + (away if k.endswith("position") else 0) for k, v in start.items()}
    here, there = lab.states(start, 0.8), lab.states(other, 0.8)
    assert there["b.position"] == pytest.approx(here["b.position"] @ turn.T + away, abs=1e-9)
