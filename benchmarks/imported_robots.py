"""Models that nobody here wrote: each is imported, compared with MuJoCo, compiled, timed, dropped and drawn.

    python benchmarks/imported_robots.py build/imported             # all; what is measured already is not done again
    python benchmarks/imported_robots.py build/imported urdf/go1    # some
    python benchmarks/imported_robots.py build/imported --table     # print what there is

One model after the other, each in a process of its own with limits of time and memory. The figures of each are a JSON
file and a picture in the folder. Run with ``make bench-imports``.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any

import casadi as ca
import mujoco
import numpy as np
from imported_model import begin, grounded, imported
from imported_pictures import contact_sheet, picture, trajectory_of
from imported_table import table
from robot_matching import Match, matched
from robot_models import RobotModel, all_models
from robot_motion import agreement
from robot_speed import Compiled, compiled, motion, speed

from symphys.model.state_layout import initial_state
from symphys.problem import Problem
from symphys.trajectory import Trajectory
from symphys.types import Array

Row = dict[str, Any]
POSES = 5
MOST_POINTS = 120
"""Of contact: models with more are measured without collisions of their own bodies."""
SECONDS, GIGABYTES = 300, 12
"""Limits of one model."""


def main() -> None:
    """Measure what is asked for, print the table, draw the sheet."""
    out, names = Path(sys.argv[1]), sys.argv[2:]
    models = {model.name: model for model in all_models()}
    if names[:1] == ["--one"]:
        write(out, names[1], measured(models[names[1]], out))
        return
    out.mkdir(parents=True, exist_ok=True)
    for name in () if names == ["--table"] else names or models:
        if names or not place(out, name).exists():
            apart(out, name)
    rows = [json.loads(place(out, name).read_text()) for name in models if place(out, name).exists()]
    print(table(rows))
    contact_sheet([(row["name"], Path(row["picture"])) for row in rows if "picture" in row], out / "imported.png")


def place(out: Path, name: str) -> Path:
    """Where the figures of a model are kept."""
    return out / f"{name.replace('/', '-')}.json"


def write(out: Path, name: str, row: Row) -> None:
    """Keep them."""
    place(out, name).write_text(json.dumps(row, indent=1))


def apart(out: Path, name: str) -> None:
    """Measure one model in a process of its own, with an empty cache of kernels."""
    with tempfile.TemporaryDirectory() as cache:
        command = [sys.executable, *(["-P"] if sys.flags.safe_path else []), __file__, str(out), "--one", name]
        try:
            ran = subprocess.run(
                command, env=os.environ | {"SYMPHYS_CACHE": cache}, timeout=SECONDS, capture_output=True, text=True
            )
            fault = "" if ran.returncode == 0 else f"{' '.join(ran.stderr.split()[-40:])} (exit {ran.returncode})"
        except subprocess.TimeoutExpired:
            fault = f"more than {SECONDS} s"
    if fault:
        row = json.loads(place(out, name).read_text()) if place(out, name).exists() else {"name": name}
        write(out, name, row | {"fault": fault})
    print(f"{name}: {fault or 'done'}", file=sys.stderr, flush=True)


def measured(model: RobotModel, out: Path) -> Row:
    """Everything about one model; what fails is named in the row, and the rest goes on."""
    resource.setrlimit(resource.RLIMIT_AS, (GIGABYTES << 30, GIGABYTES << 30))
    row: Row = {"name": model.name}
    mujoco.set_mju_user_warning(lambda text: None)
    began = perf_counter()
    robot = imported(model)
    many = len(robot.problem.world().pairs) > MOST_POINTS
    robot = imported(model, self_collision=False) if many else robot
    row |= (
        {"imported": perf_counter() - began, "self_collision": not many}
        | counts(robot.problem)
        | findings(robot.findings)
    )
    write(out, model.name, row)
    match = matched(robot.problem.world(), robot.placed, model.reference())
    path = place(out, model.name).with_suffix(".png")
    qpos = begin(match, robot)
    made: list[Compiled] = []
    stages: dict[str, Callable[[], Row]] = {
        "data": lambda: same_data(match),
        "motion": lambda: free_motion(match),
        "kernel": lambda: kernel(robot.problem, made),
        "fall": lambda: falls(robot.problem, match, made[0], qpos, path),
        "speed": lambda: asdict(speed(match, grounded(model, robot), made[0], qpos)),
    }
    for name, stage in stages.items():
        try:
            row |= stage()
        except Exception as error:  # the table says what failed
            row.setdefault("failed", {})[name] = f"{type(error).__name__}: {error}"[:300]
        write(out, model.name, row)
    return row


def counts(problem: Problem) -> Row:
    """What was imported."""
    world = problem.world()
    return {
        "bodies": sum(float(body.mass) > 0 for body in world.bodies),
        "joints": sum(joint.kind.name != "fixed" for joint in world.joints),
        "motors": sum(joint.driven for joint in world.joints),
        "contacts": len(world.pairs),
        "dt": problem.simulation.dt,
        "frames": sum(float(body.mass) == 0 for body in world.bodies),
    }


def findings(found: Any) -> Row:
    """How many of each kind, and what was left out or approximated."""
    kinds = Counter(each.kind for each in found)
    return {
        "findings": dict(kinds),
        "left_out": [each.what for each in found if each.kind == "left out"],
        "approximated": [each.what for each in found if each.kind == "approximated"],
    }


def same_data(match: Match) -> Row:
    """Masses, centres and mass matrices at random poses: largest differences."""
    rng, masses, centres, matrices = np.random.default_rng(0), [], [], []
    for _ in range(POSES):
        qpos, _ = match.random(rng)
        here, place_here, there, place_there = match.centres(qpos)
        masses.append(abs(here / there - 1))
        centres.append(float(np.abs(place_here - place_there).max()))
        matrix = match.mass_matrix_there(qpos)
        matrices.append(float(np.abs(match.mass_matrix(qpos) - matrix).max() / np.abs(matrix).max()))
    return {"dof": match.model.nv, "mass": max(masses), "centre": max(centres), "matrix": max(matrices)}


def free_motion(match: Match) -> Row:
    """Errors and their order."""
    found = agreement(match)
    return {"duration": found.duration, "steps": found.steps, "errors": found.errors, "order": found.order}


def kernel(problem: Problem, made: list[Compiled]) -> Row:
    """The steps, compiled with an empty cache."""
    made.append(compiled(problem.world(), problem.simulation.scheme()))
    return {"compiled": made[0].seconds, "compiled_work": made[0].work}


def falls(problem: Problem, match: Match, made: Compiled, qpos: Array, path: Path) -> Row:
    """A second of motion with contact, and its picture."""
    world, scheme = match.world, problem.simulation.scheme()
    x = match.x(qpos, np.zeros(match.model.nv))
    known = np.array(ca.DM(initial_state(world, problem.initial))).ravel()
    states = motion(made, x, max(1, round(1 / (scheme.dt * made.steps))))
    found = trajectory_of(world, states, made.steps * scheme.dt)
    row = quiet(found) | {"start": float(np.abs(x - known).max())}
    if row["finite"]:
        picture(problem, found, path)
        row["picture"] = str(path)
    return row


def quiet(motion: Trajectory) -> Row:
    """Whether it stays finite and does not fly away."""
    return {
        "finite": bool(np.isfinite(motion.position).all()),
        "highest": float(motion.position[..., 2].max()),
        "lowest": float(motion.position[..., 2].min()),
        "fastest": float(np.linalg.norm(motion.velocity, axis=-1).max()),
    }


if __name__ == "__main__":
    main()
