"""Friction of two coefficients, along and across a direction: the ellipse of impulses and maximal dissipation."""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from tools.laboratory import Lab, central_difference, value_and_gradient
from tools.repeats import few, thorough
from worlds.blocks import block, rod, turned_by

import symphys
from symphys.dynamics.functions import report_function
from symphys.maths import rotation
from symphys.model.shapes import Plane, Sphere
from symphys.model.state_layout import initial_state
from symphys.model.world import Body, Law, Scheme, make_world
from symphys.transcription import transcribe
from symphys.types import Array

G = 9.81
ALONG, ACROSS = 0.6, 0.3
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
HALVES, FLAT = (0.2, 0.2, 0.05), {"b.position": [0, 0, 0.05]}
PUCK, DOWN = Body("b", 1.0, 1e9, (Sphere(0.1),)), {"b.position": [0, 0, 0.1]}
"""A ball too sluggish to roll, so that it slides on one point."""


def law(direction: tuple[float, ...] = X, **more: Any) -> Law:
    """Of two coefficients."""
    return Law((ALONG, ACROSS), friction_direction=direction, **more)


def slid(given: Law, velocity: tuple[float, ...], time: float = 0.3, dt: float = 0.01, **start: Any) -> Array:
    """(3,): the velocity of the puck after a while."""
    world = make_world([PUCK], [Plane.ground()], laws={("b", "ground"): given})
    states = Lab(world, Scheme(dt=dt)).states({**DOWN, **start, "b.velocity": velocity}, time)
    return np.array(states["b.velocity"][-1])


@cache
def incline() -> Lab:
    """The block on a slope: gravity is a parameter."""
    g = [ca.SX.sym(f"g{k}") for k in range(3)]
    return Lab(make_world([block("b", HALVES)], [Plane.ground()], law(), tuple(g)), Scheme(), parameters=g)


@pytest.mark.slow
@pytest.mark.parametrize(("heading", "mu"), [(X, ALONG), (Y, ACROSS)])
@pytest.mark.parametrize("share", [0.98, 1.02])
def test_a_block_on_a_slope_sticks_up_to_the_coefficient_of_its_direction(
    heading: tuple[float, ...], mu: float, share: float
) -> None:
    """tan(slope) = mu, along and across; above it slides by g (sin - mu cos)."""
    slope = np.arctan(share * mu)
    gravity = G * np.array([np.sin(slope) * heading[0], np.sin(slope) * heading[1], -np.cos(slope)])
    end = incline().states(FLAT, 1.0, p=gravity)["b.velocity"][-1]
    expected = G * max(np.sin(slope) - mu * np.cos(slope), 0)
    assert end == pytest.approx(expected * np.array(heading), abs=2e-3)
    assert share > 1 or np.linalg.norm(end) < 1e-6


@pytest.mark.parametrize(("velocity", "brake"), [((3, 0, 0), (ALONG, 0, 0)), ((0, 2, 0), (0, ACROSS, 0))])
def test_a_block_that_slides_along_or_across_is_braked_by_that_coefficient(
    velocity: tuple[float, ...], brake: tuple[float, ...]
) -> None:
    assert slid(law(), velocity) == pytest.approx(np.array(velocity) - 0.3 * G * np.array(brake), abs=1e-9)


@few("angle", [0.2, 0.8, 1.4, 2.5, -1.0], 2)
def test_the_force_on_sliding_surfaces_takes_most_power(angle: float) -> None:
    """It is -load M^2 v / |M v|, on the ellipse: no other force that the load admits takes more power."""
    v, m = np.array([np.cos(angle), np.sin(angle)]), np.array([ALONG, ACROSS])
    world = make_world([PUCK], [Plane.ground()], law())
    step = report_function(world, Scheme(dt=1e-6))
    x = initial_state(world, {**DOWN, "b.velocity": [*v, 0]})
    for _ in range(2):
        forces = step(x, [], [], 0)[1]
        x = step(x, [], [], 0)[0]
    force = np.array(forces).reshape(-1, 3).sum(axis=0)
    load, push = force[2], force[:2]
    assert push == pytest.approx(-load * m**2 * v / np.linalg.norm(m * v), rel=1e-4)
    assert np.linalg.norm(push / m) <= load * (1 + 1e-12)
    turns = np.linspace(0, 2 * np.pi, 400)
    others = load * m[:, None] * np.array([np.cos(turns), np.sin(turns)])
    assert push @ v <= (v @ others).min() + 1e-5 * load


def test_a_slide_at_an_angle_turns_as_the_ellipse_says() -> None:
    """d v_i / dt = -g mu_i^2 v_i / |M v|, so that (v1 / v1(0))^(1 / mu1^2) = (v2 / v2(0))^(1 / mu2^2); order dt."""
    start = np.array([3.0, 2.0])
    off = []
    for dt in (0.02, 0.01, 0.005):
        end = slid(law(), (*start, 0), 0.5, dt)[:2]
        logs = np.log(end / start) / np.array([ALONG, ACROSS]) ** 2
        off.append(logs[0] - logs[1])
    assert (8 * off[2] - 6 * off[1] + off[0]) / 3 == pytest.approx(0, abs=1e-3)
    assert off[0] / off[1] == pytest.approx(2, rel=0.1)
    assert off[1] / off[2] == pytest.approx(2, rel=0.1)


@pytest.mark.parametrize("smoothing", [0.0, 0.05])
@pytest.mark.parametrize("shape", ["ball", *(pytest.param(each, marks=pytest.mark.slow) for each in ("block", "rod"))])
def test_equal_coefficients_are_one(smoothing: float, shape: str) -> None:
    """Of a ball; of a block, which Newton's method starts; of a rod, whose contacts are solved by themselves."""
    bodies = {"ball": Body.ball("b", 0.1, 1.0), "block": block("b", HALVES), "rod": rod("b", 0.01, 0.5)}
    start = {"b.position": [0, 0, 0.4], "b.velocity": [2, 1, -1], "b.orientation": turned_by((1, 2, 0), 0.5)}
    start["b.angular_velocity"] = [1, -2, 3]
    ends = []
    for given in (Law(0.4, 0.3), Law((0.4, 0.4), 0.3, friction_direction=(1, 2, 0))):
        lab = Lab(make_world([bodies[shape]], [Plane.ground()], given), Scheme())
        ends.append(lab.states(start, 0.4, smoothing=smoothing))
    for name in ("b.position", "b.velocity", "b.angular_velocity"):
        assert ends[1][name] == pytest.approx(ends[0][name], abs=1e-7)


@pytest.mark.parametrize(
    ("shape", "smoothing"),
    [("ball", 0.0), ("ball", 0.02), thorough("block", 0.0), thorough("block", 0.02)],
)
def test_derivatives_by_the_coefficients_and_the_start(smoothing: float, shape: str) -> None:
    """Against central differences, of a landing and a slide at an angle."""
    mu = [ca.SX.sym("along"), ca.SX.sym("across")]
    body = Body.ball("b", 0.1, 1.0) if shape == "ball" else block("b", HALVES)
    world = make_world([body], [Plane.ground()], Law((mu[0], mu[1]), friction_direction=(1, 0.3, 0)))
    lab = Lab(world, Scheme(), parameters=mu)
    height = 0.13 if shape == "ball" else 0.09

    def end(z: Any) -> Any:
        start = {"b.position": [0, 0, height], "b.velocity": ca.vertcat(z[2:4], -0.2)}
        start |= {"b.orientation": turned_by((1, 2, 0), 0.05), "b.angular_velocity": [0.1, 0.2, 0.5]}
        found = lab.trajectory(start, 0.1, p=z[:2], smoothing=smoothing)[:, -1]
        return ca.vertcat(found[lab.layout["b.position"]], found[lab.layout["b.velocity"]])

    at = [ALONG, ACROSS, 3.0, 2.0]
    _, slope = value_and_gradient(end, at)
    assert np.abs(slope[:, :2]).max(axis=0).min() > 0.1
    assert slope == pytest.approx(central_difference(end, at), rel=1e-5, abs=1e-6)


@few("mu", [(0.0, 0.5), (0.5, 0.0), (0.5, 0.2), (0.0, 0.0)], 2)
@pytest.mark.parametrize("direction", [X, Z, (0.01, 0.0, 1.0)])
def test_values_and_slopes_are_finite_everywhere(mu: tuple[float, float], direction: tuple[float, ...]) -> None:
    """At rest, in the air, sliding; without friction one way; with a direction that is normal to the ground."""
    symbols = [ca.SX.sym("along"), ca.SX.sym("across")]
    given = Law((symbols[0], symbols[1]), friction_direction=direction)
    world = make_world([Body.ball("b", 0.05, 1.0)], [Plane.ground()], given)
    lab = Lab(world, Scheme(), parameters=symbols)
    x, p, s = ca.MX.sym("x", lab.layout.size), ca.MX.sym("p", 2), ca.MX.sym("s")
    after = lab.step(x, [], p, s)
    slopes = ca.Function("slopes", [x, p, s], [after, ca.jacobian(after, ca.vertcat(x, p, s))])
    for height, velocity in (
        (0.05, [0, 0, 0]),
        (0.05, [1, 0, 0]),
        (0.05, [0, 1, 0]),
        (0.3, [0, 0, 0]),
        (0.06, [1, 1, -2]),
    ):
        start = initial_state(world, {"b.position": [0, 0, height], "b.velocity": velocity})
        for smoothing in (0.0, 1e-3):
            assert all(np.isfinite(np.array(each)).all() for each in slopes(start, list(mu), smoothing))


def test_a_direction_normal_to_the_contact_leaves_the_friction_across_it() -> None:
    assert slid(law(Z), (3, 2, 0)) == pytest.approx(slid(Law(ACROSS), (3, 2, 0)), abs=1e-9)


def test_a_direction_of_a_body_turns_with_it() -> None:
    """Turned by a quarter it slides along x across its own x axis; of a direction that leans its part counts."""
    turned = {"b.orientation": turned_by(Z, np.pi / 2)}
    end = slid(law((1, 0, 0.5), friction_frame="b"), (2, 0, 0), **turned)
    assert end == pytest.approx([2 - 0.3 * G * ACROSS, 0, 0], abs=1e-9)


@few("frame", ["one", "other"], 1)
def test_the_order_of_two_bodies_does_not_matter(frame: str) -> None:
    """Two balls that hit each other off their centres; the impulse on one is opposite to that on the other."""
    bodies = {"one": Body.ball("one", 0.1, 1.0), "other": Body.ball("other", 0.2, 3.0)}
    start = {"one.position": [-0.5, 0.03, 0.05], "one.velocity": [3, 0, 0.4], "one.angular_velocity": [1, 5, -7]}
    start |= {"one.orientation": turned_by((1, 2, 3), 0.7), "other.orientation": turned_by((3, 1, 2), 1.1)}
    found = []
    for order in (("one", "other"), ("other", "one")):
        given = {("one", "other"): law((0.2, 0.8, 0.3), friction_frame=frame)}
        world = make_world([bodies[name] for name in order], [], gravity=(0, 0, 0), laws=given)
        found.append(Lab(world, Scheme(sweeps=30)).states(start, 0.3))
    for name in ("one.velocity", "other.velocity", "one.angular_velocity", "other.angular_velocity"):
        assert found[0][name] == pytest.approx(found[1][name], abs=1e-9)
    assert found[0]["one.velocity"][-1] + 3 * found[0]["other.velocity"][-1] == pytest.approx([3, 0, 0.4], abs=1e-12)
    assert np.abs(found[0]["other.velocity"][-1]).min() > 0.01


@pytest.mark.slow
@few("seed", range(4), 1)
def test_no_step_adds_energy(seed: int) -> None:
    """Of a block that is thrown down; what is left is the error of its free rotation."""
    rng = np.random.default_rng(seed)
    start = {"b.position": [0, 0, 0.4], "b.velocity": [2, 1, -1], "b.angular_velocity": rng.normal(size=3)}
    start["b.orientation"] = turned_by(rng.normal(size=3), 0.5)
    world = make_world([block("b", HALVES)], [Plane.ground()], Law((0.8, 0.1), 0.5, friction_direction=(1, 1, 0)))
    states = Lab(world, Scheme()).states(start, 1.0)
    moments, energies = np.array(block("b", HALVES).inertia), []
    fields = (states[f"b.{key}"] for key in ("position", "orientation", "velocity", "angular_velocity"))
    for p, q, v, w in zip(*fields, strict=True):
        inside = np.array(rotation.matrix(q)).T @ w
        energies.append(0.5 * v @ v + 0.5 * inside @ (moments * inside) + G * p[2])
    assert np.diff(energies).max() < 1e-3
    assert energies[0] - energies[-1] > 1


def file(**tables: Any) -> symphys.Problem:
    """A ball that slides at an angle."""
    body = {"name": "b", "shape": {"sphere": {"radius": 0.1}}, "mass": 1.0, "position": [0, 0, 0.1]}
    body |= {"velocity": [3, 2, 0], **tables.pop("body", {})}
    return symphys.load({"simulation": {"duration": 0.1, "dt": 0.01}, "ground": {}, "body": [body], **tables})


TWO = {"friction": [ALONG, ACROSS], "friction_direction": [1, 0, 0]}


def test_files_state_it_of_surfaces_pairs_and_all_contacts() -> None:
    """A surface with one number multiplies both; a pair overrides; the direction of a body is in its frame."""
    ground = file(ground=TWO).world().pairs[0].law
    assert (ground.friction, ground.friction_direction, ground.friction_side) == ((ALONG, ACROSS), X, None)
    assert file(contact=TWO).world().pairs[0].law == ground
    pair = {"between": ["b", "ground"], **TWO}
    assert file(pair=[pair], ground={"friction": 0.1}).world().pairs[0].law == ground
    rubbed = file(ground={"friction": 0.5}, body=TWO).world().pairs[0].law
    assert rubbed.friction == pytest.approx((ALONG / 2, ACROSS / 2))
    assert (rubbed.friction_frame, rubbed.friction_side) == ("b", 0)
    framed = file(pair=[{**pair, "friction_frame": "b"}]).world().pairs[0].law
    assert (framed.friction_frame, framed.friction_side) == ("b", 0)
    plain = file(ground=TWO, pair=[{"between": ["b", "ground"], "friction": 0.2}]).world().pairs[0].law
    assert (plain.friction, plain.friction_direction) == (0.2, None)


def test_variables_and_settings_set_both_coefficients() -> None:
    variable = {"name": "mu", "sets": "ground.friction", "guess": [0.5, 0.4]}
    target = {"name": "stops", "value": "b.position[0:2] - [0.2, 0.1]", "tolerance": 0.01}
    problem = file(
        ground=TWO, variable=[variable], target=[target], output=[{"name": "m", "value": "ground.friction[1]"}]
    )
    made = transcribe(problem, backend="casadi").shooting
    z = made.start(0)
    slopes = made.evaluator.gradient(z[None], 0.0).gradient[0]
    h = 1e-6 * np.eye(2)
    merits = [made.evaluator.value(np.stack([z + d, z - d]), 0.0).merit for d in h]
    assert slopes == pytest.approx([(a - b) / 2e-6 for a, b in merits], rel=1e-5)
    assert problem.set({"ground.friction": [0.7, 0.1]}).world().pairs[0].law.friction == (0.7, 0.1)


def test_a_world_from_python_is_a_file() -> None:
    given = law(friction_frame="b")
    world = make_world([block("b", HALVES)], [Plane.ground()], laws={("b", "ground"): given})
    assert (
        symphys.Problem.from_world(world, {"b.position": [0, 0, 0.05]}, duration=0.1).world().pairs[0].law
        == world.pairs[0].law
    )
    for bad, key in (
        (Law((0.1, 0.2)), "friction"),
        (Law(0.1, friction_direction=X), "friction_direction"),
        (law(friction_frame="c"), "friction_frame"),
    ):
        with pytest.raises(symphys.SymphysError, match=key):
            make_world([block("b", HALVES)], [Plane.ground()], bad)
