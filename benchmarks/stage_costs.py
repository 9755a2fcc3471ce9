"""Costs of a problem step by step: values of eight motions, slopes and curvature of one, compiled and not.

The walking robot with its costs, 16 motors with a knot for each of 100 steps. CPU time of one thread, fastest of 20.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from functools import partial
from time import process_time

import numpy as np

from symphys import problems
from symphys.problem import problem_of_tables
from symphys.transcription.rollout import symbolic_rollout
from symphys.transcription.staged import stage_functions
from symphys.transcription.staged.staged_problem import RolloutStages

MOTORS = [f"{leg}_{joint}" for leg in ("fl", "fr", "hl", "hr") for joint in ("yaw", "roll", "pitch", "elbow")]
STANDING = [0, 0, 0.436, -0.873] * 4


def fastest(call: Callable[[], object]) -> float:
    """[ms] of CPU time."""
    times = []
    for _ in range(20):
        began = process_time()
        call()
        times.append(process_time() - began)
    return 1000 * min(times)


def main() -> None:
    """Print the table."""
    task = tomllib.loads(problems.find("quadruped_walk").with_name("tasks").joinpath("walk_ahead.toml").read_text())
    tables = {key: task[key] for key in ("ground", "pair", "cost", "constraint")}
    scheme = {"duration": 1.0, "dt": 0.01, "sweeps": 20, "cuts": 0, "time_of_impact": False}
    knots = [
        {"name": f"of_{name}", "sets": f"{name}.command", "knots": 100, "guess": float(angle)}
        for name, angle in zip(MOTORS, STANDING, strict=True)
    ]
    robot = [{"file": "robots/table_robot.toml"}]
    problem = problem_of_tables({**tables, "simulation": scheme, "include": robot, "variable": knots})
    rollout, z = symbolic_rollout(problem), np.concatenate([variable.guess for variable in problem.variables])
    print("| ms | values of 8 motions | slopes and curvature |\n|---|---|---|")
    for name, least in (("compiled", 0), ("casadi's virtual machine", 10**12)):
        stage_functions.COMPILED = least
        staged = RolloutStages(rollout, threads=1, exact=True)
        motion = staged.roll_out(z, 0.0)
        Z, X, U = (np.repeat(each[None], 8, axis=0) for each in (z, motion.x, motion.u))
        none = np.zeros(len(staged.lower))
        calls = partial(staged.measure, Z, X, U), partial(staged.expand, motion, none, 2 * staged.penalties)
        print(f"| {name} | " + " | ".join(f"{fastest(call):.2f}" for call in calls) + " |")


if __name__ == "__main__":
    main()
