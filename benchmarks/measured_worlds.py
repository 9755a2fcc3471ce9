"""Worlds that several benchmarks measure: a table robot with a net, spheres on the ground, heaps, balls in a box."""

from __future__ import annotations

import json
from collections.abc import Iterable
from math import dist
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from symphys.problem import Problem, load_problem
from symphys.types import Array

LEGS = {"fl": 1, "fr": -1, "hl": -1, "hr": 1}
"""The legs with their phase in a trot."""
SENSORS = ("angles", "rates", "commands", "impulses", "imu", "loads", "clock", "height")
BENT = {"pitch": 0.436332, "elbow": -0.872665}
"""Angles at which the robot stands [rad]."""
ROBOT = """
[simulation]
duration = {duration}
dt = 0.01
sweeps = 20
cuts = 0
time_of_impact = {toi}

[[include]]
file = "robots/table_robot.toml"

[ground]
friction = 0.8

[[controller]]
name = "trot"
drives = {commands}
periodic = {{ frequency = 1.5, offsets = {offsets}, sines = {sines}, cosines = {cosines} }}

[[controller]]
name = "brain"
drives = {commands}
senses = {sensors}
scale = 0.2
net = {{ hidden = {hidden}, output = "tanh", biases = false, spread = 0.3 }}

[[variable]]
name = "weights"
sets = "brain.weights"

[[variable]]
name = "start"
sets = "torso.velocity"

[[cost]]
name = "distance"
value = "-torso.position[0]"
"""
HEAD = """
[simulation]
duration = {duration}
dt = {dt}
sweeps = {sweeps}

[ground]
friction = {friction}
restitution = {restitution}
"""
BALL = """
[[body]]
name = "ball{i}"
shape = {{ sphere = {{ radius = 0.1 }} }}
mass = 1.0
position = {position}
{more}

[[variable]]
name = "start{i}"
sets = "ball{i}.velocity"
guess = {velocity}

[[target]]
name = "end{i}"
value = "ball{i}.position"
tolerance = 0.01
"""
HALF = 0.6
"""Half the width of the box [m]."""
WALLS = {"left": (1, 0), "right": (-1, 0), "front": (0, 1), "back": (0, -1)}


def problem_of(text: str) -> Problem:
    """Return the problem of a file's text."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "world.toml"
        path.write_text(text, encoding="utf-8")
        return load_problem(path)


def guess_of(problem: Problem) -> Array:
    """Return the decision vector (n,) of the guesses."""
    return np.concatenate([variable.guess for variable in problem.variables])


def around(guess: Array, batch: int = 128) -> Array:
    """Return decision vectors (batch, n) near a guess."""
    return np.asarray(guess + 0.01 * np.random.default_rng(0).standard_normal((batch, guess.size)))


def table_problem(hidden: list[int], steps: int, stride: float = 0.1, toi: bool = False) -> Problem:
    """Return the table robot with a net on all sensors, beside a trot; z is (weights, velocity of the torso).

    Args:
        hidden: sizes of the hidden layers.
        steps: of 10 ms.
        stride: amplitude of the trot [rad].
        toi: whether steps use the time of impact.
    """
    joints = [(leg, kind) for leg in LEGS for kind in ("yaw", "roll", "pitch", "elbow")]
    return problem_of(
        ROBOT.format(
            duration=steps * 0.01,
            toi=str(toi).lower(),
            commands=json.dumps([f"{leg}_{kind}.command" for leg, kind in joints]),
            offsets=[BENT.get(kind, 0.0) for _, kind in joints],
            sines=[stride * LEGS[leg] * (kind == "pitch") for leg, kind in joints],
            cosines=[stride * LEGS[leg] * (kind == "elbow") for leg, kind in joints],
            sensors=json.dumps(SENSORS),
            hidden=hidden,
        )
    )


def starts(robots: int) -> Array:
    """Return velocities (robots, 3) of the torso [m/s]; the first robot stands still."""
    velocities = np.random.default_rng(0).normal(0, 0.05, (robots, 3))
    velocities[0] = 0
    return velocities


def robots_of(problem: Problem, robots: int) -> Array:
    """Return decision vectors (robots, n) of table robots with the same weights and different starts."""
    return np.hstack([np.tile(problem.variables[0].guess, (robots, 1)), starts(robots)])


def spheres_on_ground(count: int, sweeps: int = 10, steps: int = 50) -> Problem:
    """Return spheres that roll on the ground, three contact constraints each; they pass through each other."""
    places = [(0.3 * (i % 8), 0.3 * (i // 8), 0.1) for i in range(count)]
    return _balls(places, [["ground"]] * count, sweeps, steps)


def pile(count: int, sweeps: int = 10, steps: int = 20) -> Problem:
    """Return spheres in a heap on the ground; those that lie within three radii of each other may collide."""
    side = max(1, round((count / 2) ** 0.5))
    layers = [divmod(i, side * side) for i in range(count)]
    places = [(0.205 * (k % side), 0.205 * (k // side), 0.1 + 0.203 * layer) for layer, k in layers]
    partners = []
    for i, at in enumerate(places):
        near = [f"ball{j}" for j in range(count) if j != i and dist(at, places[j]) < 0.3]
        partners.append((["ground"] if at[2] < 0.2 else []) + near)
    return _balls(places, partners, sweeps, steps)


def _balls(places: Iterable[tuple[float, ...]], partners: Iterable[list[str]], sweeps: int, steps: int) -> Problem:
    parts = [HEAD.format(duration=steps * 0.01, dt=0.01, sweeps=sweeps, friction=0.5, restitution=0.3)]
    for i, (place, meets) in enumerate(zip(places, partners, strict=True)):
        more = f"collides_with = {json.dumps(meets)}"
        parts.append(BALL.format(i=i, position=list(place), velocity=[0.5, 0.2, 0.0], more=more))
    return problem_of("".join(parts))


def box_starts(scene: str) -> tuple[Array, Array, float]:
    """Return positions (balls, 3) [m], velocities (balls, 3) [m/s] and the duration [s] of "bounce" or "box"."""
    if scene == "bounce":
        return np.array([[0.0, 0, 1.0]]), np.array([[0.5, 0, 0]]), 2.0
    places = np.array([[x, y, z] for z in (0.15, 0.5) for y in (-0.35, 0.35) for x in (-0.45, -0.15, 0.15, 0.45)])
    return places, np.random.default_rng(0).uniform(-1, 1, places.shape), 0.5


def balls_in_a_box(scene: str = "box", dt: float = 0.01) -> Problem:
    """Return 16 balls between four walls, or in the scene "bounce" one ball on the ground."""
    places, velocities, duration = box_starts(scene)
    parts = [HEAD.format(duration=duration, dt=dt, sweeps=8, friction=0.3, restitution=0.7)]
    parts.append("[contact]\nfriction = 0.3\nrestitution = 0.7\n")
    for name, (x, y) in WALLS.items() if scene == "box" else ():
        parts.append(f'[[plane]]\nname = "{name}"\nnormal = [{x}, {y}, 0]\noffset = {-HALF}\n')
    for i, (place, velocity) in enumerate(zip(places.tolist(), velocities.tolist(), strict=True)):
        parts.append(BALL.format(i=i, position=place, velocity=velocity, more=""))
    return problem_of("".join(parts))
