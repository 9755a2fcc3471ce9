"""A robot by itself as a problem: on the ground unless it stands otherwise, its motors holding the start."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from symphys.maths import rotation
from symphys.model.joints import AffineMotor, Servo
from symphys.model.joints.frames import WORLD
from symphys.model.scalar import is_zero
from symphys.problem.include import with_included
from symphys.problem.model import NOTHING
from symphys.problem.parametric.joints import ParametricJoint
from symphys.problem.problem import Problem, problem_of_tables
from symphys.problem.reading.source import parse_toml, read_source

DURATION, STEP = 2.0, 0.005
"""[s]"""
DROP_HEIGHT = 0.02
"""[m] that the lowest point of a robot without a ground of its own begins above the one that it gets."""
SUPPORTS = ("ground", "plane", "block", "terrain")
"""Tables of what a robot may stand on."""
HOLDING_CONTROLLER = "hold_the_start"
"""The controller of the motors."""


def is_robot(path: Path) -> bool:
    """Whether a file is a robot by itself: a model of another program, or bodies without a simulation."""
    if path.suffix.lower() != ".toml":
        return path.suffix.lower() in (".xml", ".urdf", ".mjcf")
    tables = parse_toml(path, read_source(path))
    return "body" in tables and "simulation" not in tables


def robot_alone(path: Path, settings: Mapping[str, object] = NOTHING, **include: Any) -> Problem:
    """A robot for two seconds: it falls to the ground, and motors that can hold the pose of the start do so.

    Args:
        path: of a file that problems may include.
        settings: see ``load_problem``.
        include: further keys of its [[include]] table.

    Raises:
        ProblemError: names the file and every fault found.
    """
    tables: dict[str, Any] = {"include": [{"file": path.name, **include}]}
    merged = with_included(path.parent / f"{path.stem} alone.toml", tomli_w.dumps(tables), tables)
    whole = parse_toml(path, merged.text)
    whole["simulation"] = {"duration": DURATION, "dt": STEP}
    whole["title"] = str(parse_title(whole, path.stem))
    untouched = problem_of_tables({**whole, **without_contact(merged.data)}, path.stem)
    if not stands(merged.data):
        low = lowest(untouched)
        if low < inf:
            whole["include"][0]["position"] = [0.0, 0.0, DROP_HEIGHT - low]
            whole["ground"] = {}
    hold = holding_controller(untouched)
    if hold is not None:
        whole["controller"] = [hold]
    return problem_of_tables(whole, path.stem, settings=settings)


def without_contact(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Tables in which nothing may touch, which are checked in a moment."""
    alone = [{key: value for key, value in body.items() if key != "group"} for body in tables.get("body", ())]
    bodies = [{**body, "collides_with": []} for body in alone]
    return {**tables, "body": bodies, "include": [], "included": [], "pair": []}


def parse_title(tables: Mapping[str, Any], name: str) -> object:
    """Return the title of the included file, or its file name."""
    (kept,) = tables["included"]
    return parse_toml(Path(kept["file"]), kept["text"]).get("title", name)


def stands(tables: Mapping[str, Any]) -> bool:
    """Whether there is something to stand on, or a joint holds a body to the world."""
    held = any(WORLD in joint.get("between", ()) for joint in tables.get("joint", ()))
    return held or any(key in tables for key in SUPPORTS)


def lowest(problem: Problem) -> float:
    """[m]: the least height of all surfaces of bodies at the start; infinite without any."""
    least = inf
    for body in problem.world().bodies:
        place, turn = (problem.initial[f"{body.name}.{key}"] for key in ("position", "orientation"))
        axes = np.array(rotation.matrix(turn), float)
        for shape in body.shapes:
            hull, own = shape.rounded_hull, np.array(rotation.matrix(np.array(shape.orientation, float)), float)
            corners = np.array(shape.centre, float) + np.array(hull.corners, float) @ own.T
            least = min(least, float((corners @ axes.T)[:, 2].min() + place[2] - hull.radius))
    return least


def holding_controller(problem: Problem) -> dict[str, Any] | None:
    """A controller that gives every motor the command at which it holds the start; None where none needs it."""
    driven = {slot for controller in problem.controllers for slot, _ in controller.drives}
    commands = {command: value for command, value in holding(problem.parametric.joints) if command not in driven}
    if not any(commands.values()):
        return None
    law = {"periodic": {"frequency": 0.0, "offsets": list(commands.values())}}
    return {"name": HOLDING_CONTROLLER, "drives": list(commands), **law}


def holding(joints: tuple[ParametricJoint, ...]) -> Iterator[tuple[str, float]]:
    """The commands of motors that aim at a coordinate, and where it is at the start."""
    for joint in joints:
        count = len(joint.kind.coordinates)
        for k, start in enumerate(joint.start or (0.0,) * count):
            command = f"{joint.name}.command" if count == 1 else f"{joint.name}.command[{k}]"
            if isinstance(joint.motor, Servo):
                yield command, float(start)
            elif isinstance(joint.motor, AffineMotor) and not is_zero(joint.motor.kp) and not is_zero(joint.motor.gain):
                yield command, aimed(joint.motor, start)


def aimed(motor: AffineMotor, coordinate: float) -> float:
    """The command at which a motor gives nothing at a coordinate, within its range."""
    value = (motor.kp * motor.gear * coordinate - motor.offset) / motor.gain
    low, high = motor.command_range or (-inf, inf)
    return float(min(max(value, low), high))
