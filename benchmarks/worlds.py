"""The worlds that are measured: problem files of any size, with a start that varies and a target to differentiate."""

from __future__ import annotations

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
APART = """
[contact]
collide = false
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
    names = [f"ball{i}" for i in range(count)]
    for i in range(count):
        ball = BALL.format(i=i, x=0.3 * (i % 8), y=0.3 * (i // 8), z=0.1)
        parts.append(ball.replace("mass = 1.0", 'mass = 1.0\ncollides_with = ["ground"]'))
    return problem_of("".join(parts) if names else parts[0])


def pile(count: int, sweeps: int = 10, steps: int = 20) -> Problem:
    """``count`` spheres in a heap on the ground; every pair may collide."""
    parts = [HEAD.format(duration=steps * 0.01, sweeps=sweeps)]
    side = max(1, round((count / 2) ** 0.5))
    for i in range(count):
        layer, place = divmod(i, side * side)
        x, y = place % side, place // side
        parts.append(BALL.format(i=i, x=0.205 * x, y=0.205 * y, z=0.1 + 0.203 * layer))
    return problem_of("".join(parts))
