"""States of a guessed motion: where they were said to be, and on the way of steps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import symphys
from symphys import Problem
from symphys.model.state_layout import Layout
from symphys.problem import load_problem
from symphys.problem.guess import recorded_guess
from symphys.transcription import guessed, transcribe
from symphys.transcription.staged.staged_problem import RolloutStages

TICKS = np.array([1, 10, 50, 100])
TIMES = TICKS * 0.02


def stages(**guess: object) -> tuple[RolloutStages, np.ndarray, np.ndarray]:
    """Of the acrobot: its stages, a decision vector, and the guessed states at TICKS."""
    problem = symphys.load("acrobot").set({"simulation.dt": 0.02, "guess": guess})
    shooting = transcribe(problem, backend="casadi").shooting
    assert shooting.staged is not None and shooting.guessed_states is not None
    made, z = shooting.staged(), np.linspace(-20, 20, shooting.n)
    assert isinstance(made, RolloutStages)
    return made, z, shooting.guessed_states(z, TICKS, 0.0)


def named(made: RolloutStages, z: np.ndarray, states: np.ndarray) -> np.ndarray:
    """(4, M) angles and rates, from the tangent at the first state, where all are 0."""
    off = made.difference(np.tile(made.start(z[None]), (len(states), 1)), states)
    return np.asarray(off[:, :4].T)


@pytest.mark.slow
def test_a_line_between_states() -> None:
    """Angles on the line, rates its slope, and the elbow between what is said of it."""
    made, z, found = stages(
        states=[{"at": 0.0, "shoulder.angle": 0}, {"at": 2.0, "shoulder.angle": 3.0, "elbow.angle": 0.5}]
    )
    shoulder, elbow, rate, still = named(made, z, found)
    assert shoulder == pytest.approx(1.5 * TIMES)
    assert elbow == pytest.approx(0.5) and still == pytest.approx(0)
    assert rate == pytest.approx(1.5)


@pytest.mark.slow
def test_a_formula_and_rates_of_its_own() -> None:
    """A formula is followed; a rate that is named is that, whatever the slope."""
    made, z, found = stages(states=[{"at": 1.0, "elbow": {"rate": 2.0}}], follows={"elbow.angle": "sin(time)"})
    _, elbow, _, rate = named(made, z, found)
    assert elbow == pytest.approx(np.sin(TIMES), abs=1e-4)
    assert rate == pytest.approx(2.0)


@pytest.mark.slow
def test_what_is_not_named_is_as_in_the_rollout() -> None:
    """And steps from a guess that is the rollout lead along it: all that a state holds is as after a step."""
    made, z, found = stages(states=[{"at": 0.0, "elbow.rate": 1.0}])
    motion = made.roll_out(z, 0.0)
    off = made.difference(motion.x[TICKS], found)
    assert off[:, 3] == pytest.approx(1.0 - named(made, z, motion.x[TICKS])[3])
    assert np.delete(off, 3, axis=1) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    ("guess", "fault"),
    [
        ({}, "guess: names nothing"),
        (
            {"states": [{"at": 3.0, "elbow.angle": 0}]},
            "guess.states[0].at: must be a time [s] from 0 to the duration, 2",
        ),
        ({"states": [{"at": 1.0, "elbo.angle": 0}]}, 'elbo.angle: a guess cannot name "elbo.angle"'),
        ({"states": [{"at": 1.0, "upper.position": [0, 0, 1]}]}, "upper.position"),
        ({"states": [{"at": 1.0, "elbow.angle": [0, 1]}]}, "elbow.angle: must be a number"),
        ({"states": [{"at": 1.0, "elbow.angle": 0}] * 2}, "another state names it at 1 s"),
        ({"states": [{"at": 1.0, "shoulder.orientation": [1, 0, 0, 0]}]}, "orientation and angular_velocity of ball"),
        ({"follows": {"elbow.angle": "sin(tim)"}}, "guess.follows.elbow.angle"),
        ({"follows": {"elbow.angle": "[time, 1]"}}, "must be 1 finite number at all times"),
    ],
)
def test_faults(guess: dict[str, object], fault: str) -> None:
    """Table, key and what would be valid."""
    with pytest.raises(symphys.ProblemError) as caught:
        symphys.load("acrobot").set("guess", guess)
    assert fault in str(caught.value)


def test_a_body_on_its_own() -> None:
    """Position and velocity of what no joint holds."""
    problem = symphys.load("ball_throw")
    assert isinstance(problem, Problem)
    there = problem.set(
        "guess", {"states": [{"at": 0.0, "ball.position": [0, 0, 1]}, {"at": 1.0, "ball.position": [2, 0, 1]}]}
    )
    shooting = transcribe(there, backend="casadi").shooting
    assert shooting.staged is not None and shooting.guessed_states is not None
    tick = round(0.5 / there.simulation.dt)
    made, x = shooting.staged(), shooting.guessed_states(shooting.start(0), np.array([tick]), 0.0)
    assert isinstance(made, RolloutStages)
    base = made.roll_out(shooting.start(0), 0.0).x[:1]
    names = made.tangent.names
    off = dict(zip(names, made.difference(base, x)[0], strict=True))
    assert base[0, :3][0] + off["ball.position[0]"] == pytest.approx(1.0)
    assert shooting.start(0)[0] + off["ball.velocity[0]"] == pytest.approx(2.0)


TOP = """
[world]
gravity = [0, 0, 0]

[simulation]
duration = 1.0
dt = 0.1

[[body]]
name = "top"
shape = { box = { size = [0.3, 0.2, 0.1] } }
mass = 1
position = [0, 0, 1]

[[variable]]
name = "spin"
sets = "top.angular_velocity"
guess = [0, 0, 1]
"""
ARM = """
[[body]]
name = "arm"
shape = { box = { size = [0.1, 0.1, 0.5] } }
mass = 1
position = [0, 0, 1.5]
orientation = { roll_deg = 30 }
collides_with = []

[[joint]]
name = "ball"
between = ["top", "arm"]
point = [0, 0, 1.2]
ball = {}
"""
TURN = np.array([0.6, -1.2, 0.4])
"""A rotation vector [rad]."""


def turned(vector: np.ndarray) -> np.ndarray:
    """The unit quaternion of a rotation vector."""
    angle = np.linalg.norm(vector)
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * vector / angle)])


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Of quaternions."""
    return np.array([p[0] * q[0] - p[1:] @ q[1:], *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))])


def inverse(q: np.ndarray) -> np.ndarray:
    """Of a unit quaternion."""
    return np.array([q[0], *-q[1:]])


def rotated(q: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """A vector turned by a unit quaternion."""
    return product(product(q, np.array([0, *vector])), inverse(q))[1:]


def spun(text: str, tmp_path: Path, **guess: object) -> dict[str, np.ndarray]:
    """The guessed state at 0.4 s by quantities."""
    (tmp_path / "top.toml").write_text(text, encoding="utf-8")
    problem = load_problem(tmp_path / "top.toml", {"guess": guess})
    shooting = transcribe(problem, backend="casadi").shooting
    assert shooting.guessed_states is not None
    x, layout = shooting.guessed_states(shooting.start(0), np.array([4]), 0.0)[0], Layout(problem.world())
    return {name: x[layout[name]] for name in layout.names()}


def same_turn(found: np.ndarray, there: np.ndarray) -> None:
    """The sign of a quaternion means nothing."""
    assert found * np.sign(found @ there) == pytest.approx(there, abs=1e-9)


def test_a_free_body_turns_on_the_geodesic(tmp_path: Path) -> None:
    """At constant angular velocity from one orientation to another."""
    first = turned(np.array([0.0, 0.3, 0.0]))
    last = -3 * product(turned(TURN), first)
    states = [{"at": 0.0, "top.orientation": first.tolist()}, {"at": 1.0, "top.orientation": last.tolist()}]
    x = spun(TOP, tmp_path, states=states)
    same_turn(x["top.orientation"], product(turned(0.4 * TURN), first))
    assert x["top.angular_velocity"] == pytest.approx(TURN, abs=1e-9)
    angles = [{"at": 0.0, "top.orientation": {"yaw_deg": 0}}, {"at": 0.8, "top": {"orientation": {"yaw_deg": 90}}}]
    same_turn(spun(TOP, tmp_path, states=angles)["top.orientation"], turned(np.array([0, 0, np.pi / 4])))
    x = spun(TOP, tmp_path, follows={"top.orientation": "[2 * cos(time), 0, 0, 2 * sin(time)]"})
    same_turn(x["top.orientation"], turned(np.array([0, 0, 0.8])))
    assert x["top.angular_velocity"] == pytest.approx([0, 0, 2])


@pytest.mark.slow
def test_a_ball_joint_turns_on_the_geodesic(tmp_path: Path) -> None:
    """The second body against the first, which turns itself; the joint stays closed, also in velocity."""
    states = [
        {"at": 0.0, "top.orientation": [1, 0, 0, 0], "ball.orientation": [1, 0, 0, 0]},
        {"at": 1.0, "top.orientation": {"yaw_deg": 90}, "ball.orientation": turned(TURN).tolist()},
    ]
    x = spun(TOP + ARM, tmp_path, states=states)
    base, lies = turned(np.array([0, 0, 0.2 * np.pi])), turned(np.array([np.pi / 6, 0, 0]))
    same_turn(x["top.orientation"], base)
    same_turn(x["arm.orientation"], product(base, product(turned(0.4 * TURN), lies)))
    spin = x["arm.angular_velocity"] - x["top.angular_velocity"]
    assert rotated(inverse(base), spin) == pytest.approx(TURN, abs=1e-8)
    arms = {"top": np.array([0, 0, 0.2]), "arm": rotated(inverse(lies), np.array([0, 0, -0.3]))}
    reach = {body: rotated(x[f"{body}.orientation"], arm) for body, arm in arms.items()}
    places = [x[f"{body}.position"] + arm for body, arm in reach.items()]
    speeds = [x[f"{body}.velocity"] + np.cross(x[f"{body}.angular_velocity"], arm) for body, arm in reach.items()]
    assert places[0] == pytest.approx(places[1], abs=1e-9) and speeds[0] == pytest.approx(speeds[1], abs=1e-8)
    x = spun(TOP + ARM, tmp_path, states=[{"at": 0.0, "ball.angular_velocity": [1, 2, 3]}])
    spin = x["arm.angular_velocity"] - x["top.angular_velocity"]
    assert rotated(inverse(x["top.orientation"]), spin) == pytest.approx([1, 2, 3], abs=1e-8)


@pytest.mark.slow
def test_a_recorded_motion_is_met(tmp_path: Path) -> None:
    """Of a body on its own and of one that hangs on its ball joint, from another start: all places and velocities."""
    (tmp_path / "top.toml").write_text(TOP + ARM, encoding="utf-8")
    problem = symphys.load(tmp_path / "top.toml")
    motion = symphys.simulate(problem, spin=[1.0, -2.0, 3.0])
    recorded = {name: motion[name] for name in motion.units if len(motion[name]) == len(motion.time)}
    there = replace(problem, guess=recorded_guess(problem.world(), motion.time, recorded))
    shooting = guessed(transcribe(problem, backend="casadi"), there).shooting
    assert shooting.guessed_states is not None
    ticks, layout = np.array([1, 4, 10]), Layout(problem.world())
    for x, tick in zip(shooting.guessed_states(shooting.start(0), ticks, 0.0), ticks.tolist(), strict=True):
        for body in ("top", "arm"):
            same_turn(x[layout[f"{body}.orientation"]], motion[f"{body}.orientation"][tick])
            for field in ("position", "velocity", "angular_velocity"):
                assert x[layout[f"{body}.{field}"]] == pytest.approx(motion[f"{body}.{field}"][tick], abs=1e-6)


def test_a_recording_is_followed(tmp_path: Path) -> None:
    """By the columns of a file that a [[reference]] names."""
    (tmp_path / "walk.csv").write_text("time,x,z\n0,0,1\n0.8,1.6,2\n", encoding="utf-8")
    text = TOP + '\n[[reference]]\nname = "walk"\nfile = "walk.csv"\n'
    x = spun(text, tmp_path, follows={"top.position": "[walk.x, 0.1, walk.z]"})
    assert x["top.position"] == pytest.approx([0.8, 0.1, 1.5]) and x["top.velocity"] == pytest.approx([2, 0, 1.25])


def test_slopes_are_those_of_the_duration_that_is_guessed(tmp_path: Path) -> None:
    """A variable makes the motion twice as long: what the table says moves half as fast."""
    long = '\n[[variable]]\nname = "long"\nsets = "simulation.duration"\nguess = 2\nlower = 0.5\nupper = 3\n'
    states = [{"at": 0.0, "top.position": [0, 0, 1]}, {"at": 1.0, "top.position": [3, 0, 1]}]
    x = spun(TOP + long, tmp_path, states=states)
    assert x["top.position"] == pytest.approx([1.2, 0, 1]) and x["top.velocity"] == pytest.approx([1.5, 0, 0])
