"""The table robot with a net of any size, walking on the spot: what ``table1.py`` and ``weights.py`` measure."""

from __future__ import annotations

import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from symphys.problem import Problem, load_problem
from symphys.types import Array

LEGS = {"fl": 1, "fr": -1, "hl": -1, "hr": 1}
"""With the phase of each in a trot."""
SENSORS = ("angles", "rates", "commands", "impulses", "imu", "loads", "clock", "height")
BENT = {"pitch": 0.436332, "elbow": -0.872665}
"""Angles at which the robot stands [rad]."""
PROBLEM = """
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


def table_problem(hidden: list[int], steps: int, stride: float = 0.1, toi: bool = False) -> Problem:
    """A net with these hidden layers on all sensors, beside a trot of ``stride`` [rad]; z is (weights, velocity)."""
    joints = [(leg, kind) for leg in LEGS for kind in ("yaw", "roll", "pitch", "elbow")]
    text = PROBLEM.format(
        duration=steps * 0.01,
        toi=str(toi).lower(),
        commands=listed(f"{leg}_{kind}.command" for leg, kind in joints),
        offsets=[BENT.get(kind, 0.0) for _, kind in joints],
        sines=[stride * LEGS[leg] * (kind == "pitch") for leg, kind in joints],
        cosines=[stride * LEGS[leg] * (kind == "elbow") for leg, kind in joints],
        sensors=listed(SENSORS),
        hidden=hidden,
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.toml"
        path.write_text(text)
        return load_problem(path)


def listed(names: Any) -> str:
    """As a TOML list."""
    return "[" + ", ".join(f'"{name}"' for name in names) + "]"


def starts(robots: int) -> Array:
    """(robots, 3) velocities of the torso [m/s]; the first stands still."""
    velocities = np.random.default_rng(0).normal(0, 0.05, (robots, 3))
    velocities[0] = 0
    return velocities


def fastest(call: Callable[[], Any], count: int) -> tuple[float, Any]:
    """Seconds of the fastest of ``count`` calls, and what the last one gave."""
    best = np.inf
    for _ in range(count):
        began = time.perf_counter()
        result = call()
        best = min(best, time.perf_counter() - began)
    return best, result


Calls = tuple[Callable[[int], Array], Callable[[int], Array]]
"""Of a number of robots: their objectives; the gradient (w,) of their sum with respect to the shared weights."""


def calls(problem: Problem, backend: str = "simd") -> Calls:
    """Compiled; large nets beside the step, small ones within it. "simd32": large nets in single precision."""
    from symphys.transcription.network_rollout import has_large_nets

    return beside(problem, backend) if has_large_nets(problem) else within(problem)


def within(problem: Problem) -> Calls:
    """The net within the compiled step, every robot with weights of its own."""
    from symphys.codegen import compile_program
    from symphys.transcription import symbolic_rollout
    from symphys.transcription.program import rollout_program

    kernel = compile_program(rollout_program(symbolic_rollout(problem), exact=True), seeded=["merit"])
    weights = problem.variables[0].guess

    def rows(robots: int) -> Array:
        return np.hstack([np.tile(weights, (robots, 1)), starts(robots)])

    def forward(robots: int) -> Array:
        return kernel.forward(rows(robots), [0.0])["objective"]

    def gradient(robots: int) -> Array:
        total: Array = kernel.gradient(rows(robots), [1.0], [0.0])[1][:, : weights.size].sum(axis=0)
        return total

    return forward, gradient


def beside(problem: Problem, backend: str) -> Calls:
    """The net beside the compiled step, its weights shared."""
    from symphys.transcription.network_rollout import LargeEvaluator, transcribe_large

    made = transcribe_large(problem, exact=True, backend=backend)
    weights, evaluator = [problem.variables[0].guess], made.shooting.evaluator
    assert isinstance(evaluator, LargeEvaluator)

    def forward(robots: int) -> Array:
        return evaluator.shared(weights, starts(robots)).objective

    def gradient(robots: int) -> Array:
        found = evaluator.shared(weights, starts(robots), gradient=True).weights
        assert found is not None
        return found[0]

    return forward, gradient


def peak() -> float:
    """The most memory that this process has had [GB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
