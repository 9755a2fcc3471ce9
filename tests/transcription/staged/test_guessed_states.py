"""States of a guessed motion: where they were said to be, and on the way of steps."""

from __future__ import annotations

import numpy as np
import pytest

import symphys
from symphys import Problem
from symphys.transcription.staged.staged_problem import RolloutStages

TICKS = np.array([1, 10, 50, 100])
TIMES = TICKS * 0.02


def stages(**guess: object) -> tuple[RolloutStages, np.ndarray, np.ndarray]:
    """Of the acrobot: its stages, a decision vector, and the guessed states at TICKS."""
    problem = symphys.load("acrobot").set({"simulation.dt": 0.02, "guess": guess})
    shooting = symphys.transcribe(problem, backend="casadi").shooting
    assert shooting.staged is not None and shooting.guessed_states is not None
    made, z = shooting.staged(), np.linspace(-20, 20, shooting.n)
    assert isinstance(made, RolloutStages)
    return made, z, shooting.guessed_states(z, TICKS, 0.0)


def named(made: RolloutStages, z: np.ndarray, states: np.ndarray) -> np.ndarray:
    """(4, M) angles and rates, from the tangent at the first state, where all are 0."""
    off = made.difference(np.tile(made.start(z[None]), (len(states), 1)), states)
    return np.asarray(off[:, :4].T)


def test_a_line_between_states() -> None:
    """Angles on the line, rates its slope, and the elbow between what is said of it."""
    made, z, found = stages(
        states=[{"at": 0.0, "shoulder.angle": 0}, {"at": 2.0, "shoulder.angle": 3.0, "elbow.angle": 0.5}]
    )
    shoulder, elbow, rate, still = named(made, z, found)
    assert shoulder == pytest.approx(1.5 * TIMES)
    assert elbow == pytest.approx(0.5) and still == pytest.approx(0)
    assert rate == pytest.approx(1.5)


def test_a_formula_and_rates_of_its_own() -> None:
    """A formula is followed; a rate that is named is that, whatever the slope."""
    made, z, found = stages(states=[{"at": 1.0, "elbow": {"rate": 2.0}}], follows={"elbow.angle": "sin(time)"})
    _, elbow, _, rate = named(made, z, found)
    assert elbow == pytest.approx(np.sin(TIMES), abs=1e-4)
    assert rate == pytest.approx(2.0)


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
    shooting = symphys.transcribe(there, backend="casadi").shooting
    assert shooting.staged is not None and shooting.guessed_states is not None
    tick = round(0.5 / there.simulation.dt)
    made, x = shooting.staged(), shooting.guessed_states(shooting.start(0), np.array([tick]), 0.0)
    assert isinstance(made, RolloutStages)
    base = made.roll_out(shooting.start(0), 0.0).x[:1]
    names = made.tangent.names
    off = dict(zip(names, made.difference(base, x)[0], strict=True))
    assert base[0, :3][0] + off["ball.position[0]"] == pytest.approx(1.0)
    assert shooting.start(0)[0] + off["ball.velocity[0]"] == pytest.approx(2.0)
