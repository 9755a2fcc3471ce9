"""A model of ``robot_models`` as a problem here, and where it begins, for both engines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from robot_matching import FREE, Match
from robot_models import RobotModel

import symphys
from symphys.model.shapes import Plane
from symphys.problem import Problem
from symphys.problem.robot_alone import STANDS
from symphys.types import Array


@dataclass(frozen=True)
class Imported:
    """A model after import.

    Attributes:
        problem: about a second of it, without commands, on the ground unless the model brings one.
        placed: (3,) and (4,) where its bodies are at coordinates 0, by name.
        starts: coordinates at which joints begin, by name.
        findings: what became of its parts.
        floor: height of the ground that was put under it [m]; None: the model brings its own.
    """

    problem: Problem
    placed: Mapping[str, Any]
    starts: Mapping[str, float]
    findings: Sequence[Any]
    floor: float | None


def imported(model: RobotModel, self_collision: bool = True) -> Imported:
    """Read by the importer, at the time step of the file; steps are not split at impacts."""
    robot = symphys.load_robot(model.path, self_collision=self_collision, base=model.base)
    dt = model.time_step()
    problem = robot.problem(dt * round(1 / dt), dt).set("simulation.cuts", 0)
    placed = {
        f"{body['name']}.{field}": body[field]
        for body in robot.tables["body"]
        for field in ("position", "orientation")
        if field in body
    }
    starts = {joint["name"]: joint["start"] for joint in robot.tables.get("joint", ()) if "start" in joint}
    own = any(key in robot.tables for key in STANDS)
    ground = [each for each in problem.world().statics if isinstance(each, Plane)]
    floor = None if own or not ground else float(ground[0].offset)
    return Imported(problem, placed, starts, robot.findings, floor)


def begin(match: Match, robot: Imported) -> Array:
    """(nq,): MuJoCo's coordinates where the problem begins."""
    qpos = match.model.qpos0.copy()
    for name, value in robot.starts.items():
        if name in match.joints:
            qpos[match.model.jnt_qposadr[match.joints[name]]] += value
    here = match.state(match.model.qpos0, np.zeros(match.model.nv))
    for root in match.roots:
        name = f"{match.world.bodies[root.body].name}.position"
        j = match.model.body_jntadr[root.there]
        assert match.model.jnt_type[j] == FREE
        at = match.model.jnt_qposadr[j]
        qpos[at : at + 3] += np.array(robot.placed[name]) - here[name]
    return qpos


def grounded(model: RobotModel, robot: Imported) -> mujoco.MjModel:
    """MuJoCo's model with all that acts, on the same ground."""
    return model.reference(robot.floor)
