"""The worlds that are measured: problem files of any size, with a start that varies and a target to differentiate."""

from __future__ import annotations

import json
from math import dist
from pathlib import Path
from tempfile import TemporaryDirectory

from symphys.problem import Problem, load_problem

HEAD = """
[simulation]
duration = {duration}
dt = 0.01
sweeps = {sweeps}

[ground]
friction = 0.5
restitution = 0.3
"""
BALL = """
[[body]]
name = "ball{i}"
shape = {{ sphere = {{ radius = 0.1 }} }}
mass = 1.0
position = [{x}, {y}, {z}]

[[variable]]
name = "start{i}"
sets = "ball{i}.velocity"
guess = [0.5, 0.2, 0.0]

[[target]]
name = "end{i}"
value = "ball{i}.position"
tolerance = 0.01
"""


def problem_of(text: str) -> Problem:
    """The problem of a file's text."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "world.toml"
        path.write_text(text, encoding="utf-8")
        return load_problem(path)


def spheres_on_ground(count: int, sweeps: int = 10, steps: int = 50) -> Problem:
    """``count`` spheres that roll on the ground, three rows each; they pass through each other."""
    parts = [HEAD.format(duration=steps * 0.01, sweeps=sweeps)]
    for i in range(count):
        ball = BALL.format(i=i, x=0.3 * (i % 8), y=0.3 * (i // 8), z=0.1)
        parts.append(ball.replace("mass = 1.0", 'mass = 1.0\ncollides_with = ["ground"]'))
    return problem_of("".join(parts))


def pile(count: int, sweeps: int = 10, steps: int = 20) -> Problem:
    """``count`` spheres in a heap on the ground; who lies within three radii of another may collide with it."""
    side = max(1, round((count / 2) ** 0.5))
    places = []
    for i in range(count):
        layer, place = divmod(i, side * side)
        places.append((0.205 * (place % side), 0.205 * (place // side), 0.1 + 0.203 * layer))
    parts = [HEAD.format(duration=steps * 0.01, sweeps=sweeps)]
    for i, at in enumerate(places):
        near = [f"ball{j}" for j in range(count) if j != i and dist(at, places[j]) < 0.3]
        partners = (["ground"] if at[2] < 0.2 else []) + near
        ball = BALL.format(i=i, x=at[0], y=at[1], z=at[2])
        parts.append(ball.replace("mass = 1.0", f"mass = 1.0\ncollides_with = {json.dumps(partners)}"))
    return problem_of("".join(parts))
