"""Numbers that a phase sets: closed forms on both sides of the switch, every way to evaluate, and what cannot be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tools.repeats import thorough

from symphys.codegen import interpret
from symphys.errors import ProblemError
from symphys.problem import Problem, problem_of_tables
from symphys.transcription import Transcription, rollout_program, transcribe
from symphys.transcription.open_step import compile_open_step
from symphys.verification.balance import balance

G, ICE, ROUGH, SPEED = 9.81, 0.05, 0.4, 2.0

SLED: dict[str, Any] = {
    "simulation": {"duration": 1.2, "dt": 0.01},
    "ground": {"friction": ROUGH},
    "body": [{"name": "sled", "shape": {"box": {"size": [0.4, 0.4, 0.1]}}, "mass": 2.0, "position": [0, 0, 0.05]}],
    "phase": [{"name": "ice", "share": 0.5, "sets": {"ground.friction": ICE}}, {"name": "asphalt"}],
    "variable": [
        {"name": "speed", "sets": "sled.velocity[0]", "guess": SPEED},
        {"name": "slippery", "sets": "ice.ground.friction"},
        {"name": "rough", "sets": "ground.friction"},
    ],
    "cost": [{"name": "far", "value": "sled.position[0]"}],
    "output": [{"name": "at the edge", "at": "end of ice", "value": "sled.velocity[0]"}],
}


def sliding(time: float, edge: float = 0.6) -> tuple[float, float]:
    """Place and velocity after some time; it stops where it may."""
    v = SPEED - ICE * G * edge
    x, left = SPEED * edge - ICE * G * edge**2 / 2, min(time - edge, v / (ROUGH * G))
    return x + v * left - ROUGH * G * left**2 / 2, v - ROUGH * G * left


def made_of(tables: dict[str, Any], **simulation: Any) -> Transcription:
    problem = problem_of_tables({**tables, "simulation": {**tables["simulation"], **simulation}})
    return transcribe(problem, backend="casadi")


@pytest.mark.thorough
def test_a_sled_slides_over_ice_then_asphalt() -> None:
    """Before it stops: velocities exact, places of second order, and exact where no impact may split a step."""
    tables = {**SLED, "phase": [{**SLED["phase"][0], "share": 2 / 3}, {"name": "asphalt"}]}
    (x, v), off, guess = sliding(0.9), [], np.array([SPEED, ICE, ROUGH])
    for dt in (0.02, 0.01):
        motion = made_of(tables, duration=0.9, dt=dt).simulate(guess)
        assert motion["sled.velocity"][-1, 0] == pytest.approx(v, rel=1e-10)
        off.append(abs(motion["sled.position"][-1, 0] - x))
        whole = made_of(tables, duration=0.9, dt=dt, cuts=0).simulate(guess)
        assert whole["sled.position"][-1, 0] == pytest.approx(x, abs=1e-10)
    assert off[0] < 1e-3 and off[1] == pytest.approx(off[0] / 4, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("dt", [0.01, *map(thorough, (0.02, 0.005))])
def test_the_stopping_distance_and_its_slopes(dt: float) -> None:
    """x = v0 t - mu g t^2 / 2 + v1^2 / 2 mu' g; it stops within a step, so that slopes are of first order."""
    made = made_of(SLED, dt=dt)
    z = made.shooting.start(0)
    assert made.judge(z).objective == pytest.approx(sliding(1.2)[0], abs=dt**2)
    assert made.judge(z).outputs["at the edge"] == pytest.approx(SPEED - ICE * G * 0.6, rel=1e-9)
    slope = np.array(made.functions.gradient(z, 0.0)[3]).ravel()
    v = SPEED - ICE * G * 0.6
    closed = [0.6 + v / (ROUGH * G), -G * 0.18 - v * 0.6 / ROUGH, -(v**2) / (2 * ROUGH**2 * G)]
    np.testing.assert_allclose(slope, closed, rtol=dt)


MIXED: dict[str, Any] = {
    "simulation": {"duration": 0.6, "dt": 0.01},
    "contact": {"friction": 0.4},
    "ground": {"friction": 0.4, "restitution": 0.3},
    "body": [
        {
            "name": "ball",
            "shape": {"sphere": {"radius": 0.1}},
            "mass": 0.5,
            "position": [0, 0, 0.3],
            "friction": 1.0,
            "restitution": 1.0,
        },
        {"name": "arm", "inertia": [0.02, 0.02, 0.02], "mass": 1.0, "position": [0, 2, 1], "collides_with": []},
    ],
    "joint": [
        {
            "name": "hinge",
            "between": ["world", "arm"],
            "hinge": {"axis": [0, 1, 0]},
            "point": [0, 2, 1.3],
            "motor": {"servo": {"gain": 20.0, "torque": 30.0, "velocity": 5.0}},
            "spring": {"stiffness": 1.0, "damping": 0.05},
        },
    ],
    "phase": [
        {"name": "first", "share": 0.4, "sets": {"ground.friction": 0.05, "hinge.torque": 20.0}},
        {
            "name": "second",
            "share": 0.7,
            "sets": {"gravity": [0.5, 0.0, -3.0], "ground.restitution": 0.8, "ground.friction": 0.1},
        },
        {"name": "third", "sets": {"hinge.stiffness": 4.0, "hinge.gain": 8.0, "hinge.torque": 0.05}},
    ],
    "force": [{"name": "wind", "on": "ball.force[1]", "value": "0.2 - 0.3 * ground.friction * ball.velocity[1]"}],
    "variable": [
        {"name": "throw", "sets": "ball.velocity", "guess": [1, 0.5, -0.2]},
        {"name": "push", "sets": "ball.force[0]", "knots": 6, "guess": 0.3},
        {"name": "aim", "sets": "hinge.command", "knots": 3, "guess": [0.6, -0.2, 0.9]},
        {"name": "slippery", "sets": "first.ground.friction"},
        {"name": "rough", "sets": "ground.friction"},
        {"name": "down", "sets": "second.gravity[2]"},
        {"name": "stiff", "sets": "third.hinge.stiffness"},
    ],
    "cost": [
        {"name": "places", "value": "sumsqr(ball.position - [1, 0, 0]) + hinge.angle**2"},
        {"name": "worth", "at": "always", "value": "(ground.friction + 0.1 * gravity[2])**2 * sumsqr(ball.velocity)"},
    ],
    "constraint": [{"name": "cone", "at": "always", "value": "ground.friction * ball.position[2]", "upper": 0.1}],
}
"""Numbers of contacts, gravity, a motor and a spring change; laws and costs name them."""


@pytest.fixture(scope="module")
def mixed() -> Transcription:
    return transcribe(problem_of_tables(MIXED), backend="casadi")


def test_adjoints_of_single_states_are_those_of_the_whole(mixed: Transcription) -> None:
    z = mixed.shooting.start(1)
    record = mixed.record(z)
    ends = np.zeros((record.arrays.x.shape[1], 1))
    ends[0] = 1.0
    pulled = mixed.pull(record, {mixed.rollout.steps: ends}, np.zeros((record.arrays.p.size, 1)))
    assert pulled is not None
    h, differences = 1e-6, []
    for e in h * np.eye(z.size):
        sides = [mixed.record(z + sign * e).arrays.x[-1, 0] for sign in (1, -1)]
        differences.append((sides[0] - sides[1]) / (2 * h))
    assert pulled[:, 0] == pytest.approx(differences, rel=1e-5, abs=1e-7)


def test_gravity_and_motors_change_at_their_time() -> None:
    """A stone under two gravities, z = v t - g t^2 / 2 in each; a motor's largest force, and its work, likewise."""
    tables: dict[str, Any] = {
        "simulation": {"duration": 1.0, "dt": 0.02},
        "world": {"gravity": [0, 0, -4.0]},
        "body": [
            {"name": "stone", "mass": 2.0, "inertia": 0.1, "velocity": [0, 0, 3.0]},
            {"name": "cart", "mass": 3.0, "inertia": 0.1, "position": [0, 1, 0], "collides_with": []},
        ],
        "joint": [
            {
                "name": "rail",
                "between": ["world", "cart"],
                "slider": {"axis": [1, 0, 0]},
                "motor": {"torque": {"torque": 6.0}},
            }
        ],
        "phase": [
            {"name": "low", "share": 0.4, "sets": {"gravity": [0, 0, -1.5], "rail.torque": 2.0}},
            {"name": "high"},
        ],
        "variable": [{"name": "push", "sets": "rail.command", "guess": 9.0}],
        "cost": [{"name": "c", "value": "cart.position[0]"}],
    }
    made = transcribe(problem_of_tables(tables), backend="casadi")
    record = made.record(made.shooting.start(0))
    motion = record.motion
    v = 3.0 - 1.5 * 0.4
    assert motion["stone.position"][-1, 2] == pytest.approx(3 * 0.4 - 0.75 * 0.16 + v * 0.6 - 2 * 0.36, abs=1e-13)
    w = 2 / 3 * 0.4
    assert motion["cart.position"][-1, 0] == pytest.approx(0.16 / 3 + w * 0.6 + 0.36, abs=1e-13)
    told = balance(made.rollout, record)
    assert told["drift"] < 1e-12 and told["momentum"] < 1e-12
    velocity = {**tables, "joint": [{**tables["joint"][0], "motor": {"velocity": {"torque": 6.0, "velocity": 50.0}}}]}
    made = transcribe(problem_of_tables(velocity), backend="casadi")
    motion = made.simulate(np.array([40.0]))
    assert motion["cart.position"][-1, 0] == pytest.approx(0.16 / 3 + w * 0.6 + 0.36, abs=1e-13)


@pytest.mark.thorough
def test_phases_scale_with_a_free_duration() -> None:
    """Twice as long: x = v0 T/2 - ..., with half of the time on ice."""
    free = {"name": "T", "sets": "simulation.duration", "guess": 0.8}
    made = made_of({**SLED, "variable": [*SLED["variable"], free]}, dt=0.04)
    z = made.shooting.start(0)
    assert made.simulate(z)["sled.velocity"][-1, 0] == pytest.approx(sliding(0.8, 0.4)[1], rel=1e-9)
    program = rollout_program(made.rollout)
    assert interpret(program, z, [0.0])["merit"] == pytest.approx(made.judge(z).objective, rel=1e-12)


@pytest.mark.slow
def test_a_phase_that_sets_nothing_costs_nothing() -> None:
    """The program is that of a problem without phases, operation by operation."""
    plain = {key: value for key, value in SLED.items() if key not in ("phase", "output")}
    plain["variable"] = [SLED["variable"][0], SLED["variable"][2]]
    programs = []
    for phases in ([], [{"name": "ice", "share": 0.5}, {"name": "asphalt"}]):
        programs.append(
            rollout_program(transcribe(problem_of_tables({**plain, "phase": phases}), backend="casadi").rollout)
        )
    sizes = [[call.function.n_instructions() for call in (*p.prologue, *p.body, *p.epilogue)] for p in programs]
    assert sizes[0] == sizes[1]
    assert programs[0].size == programs[1].size


def changed(**tables: Any) -> Problem:
    return problem_of_tables({**SLED, **tables})


def on_ice(sets: dict[str, Any]) -> list[dict[str, Any]]:
    return [{"name": "ice", "share": 0.5, "sets": {"ground.friction": ICE, **sets}}, {"name": "asphalt"}]


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"phase": on_ice({"ground.frction": 1})}, r'"ice".sets: .*"ground.frction"'),
        (
            {"phase": on_ice({"sled.mass": 1})},
            r"sled.mass is the same .* may set gravity, contact.friction, contact.restitution, ground.friction$",
        ),
        ({"phase": on_ice({"gravity": 1})}, r"gravity takes 3 numbers, not 1"),
        ({"phase": on_ice({"ground.friction": "low"})}, r"ground.friction.*'low'"),
        ({"phase": on_ice({"ground.friction": -1})}, r"ground.friction must lie in \[0, inf\], not -1"),
        ({"phase": on_ice({"sled.friction": 1})}, r"sled states no friction: give it a value there first"),
        (
            {"variable": [{"name": "v", "sets": "asphalt.ground.friction"}]},
            '"asphalt.ground.friction"',
        ),
        (
            {"variable": [{"name": "v", "sets": "ice.ground.friction", "lower": -1}]},
            r'variable "v".lower: .*',
        ),
        (
            {"sensor": [{"name": "s", "reads": ["ground.friction"]}]},
            r'sensor "s".reads: .*ground.friction',
        ),
        (
            {"phase": on_ice({"gravity": [0, 0, -5]}), "sensor": [{"name": "s", "reads": ["sled.accelerometer"]}]},
            r"looks at sled.accelerometer, which a phase changes",
        ),
        (
            {"termination": {"margin": "sled.position[2] + ground.friction"}},
            r"termination.margin: .*ground.friction",
        ),
    ],
)
def test_what_cannot_be_names_table_and_key(tables: dict[str, Any], message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        changed(**tables)


def test_single_steps_slide_over_ice_then_asphalt() -> None:
    push = {"name": "push", "sets": "sled.force", "knots": 2, "guess": [0.5, 0, 0]}
    problem = changed(variable=[*SLED["variable"], push])
    step, made = compile_open_step(problem, backend="casadi"), transcribe(problem, backend="casadi")
    state, total = step.start().state, 0.0
    for _ in range(step.steps):
        state, _, cost = step(state, np.array([[0.5, 0.0, 0.0]]))
        total += cost[0]
    z = made.shooting.start(0)
    assert total == pytest.approx(made.judge(z).objective, rel=1e-12)
    assert state[0, step.columns["sled.position"]] == pytest.approx(made.simulate(z).position[-1, 0], abs=1e-12)
