"""How long is an iteration of ilqr beside one of Crocoddyl's FDDP, on the same robots without contact?

Same masses, nodes, time steps and costs of the kind; one thread each; processes of their own, in turns. Crocoddyl has
derivatives of articulated bodies by recursion, and an Euler step; ours are those of the whole step, with joint limits.
It is no dependency: ``pip install crocoddyl==3.2.1 pin==4.0.0 libpinocchio==4.0.0`` brings it and its robots.
"""

from __future__ import annotations

import os
import statistics
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import suppress
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
from bench import Row, in_process

COLUMNS = {
    "robot": "links of the shipped acrobot, or of a URDF of example-robot-data",
    "nodes": "steps of the horizon",
    "ours_ms": "milliseconds of an iteration of ilqr, median of a solve, the best turn",
    "theirs_ms": "likewise of SolverFDDP",
    "ratio": "of the two",
    "fault": "why there is no row",
}
ARMS = {
    "ur5": ("ur_description/urdf/ur5_robot.urdf", "tool0"),
    "panda": ("panda_description/urdf/panda.urdf", "panda_hand"),
}
PLACE, NODES, DT = (0.4, 0.3, 0.4), 100, 0.01
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "SYMPHYS_WAIT": "1"}


def rows(quick: bool = False, turns: int = 5, iterations: int = 30) -> Iterator[Row]:
    """Yield a row for each robot.

    Args:
        quick: the acrobot alone, once.
        turns: of both.
        iterations: of a solve at most.
    """
    if find_spec("crocoddyl") is None:
        yield {"robot": "all", "fault": "crocoddyl is not installed, see the head of the benchmark"}
        return
    for name in ["acrobot"] if quick else ["acrobot", *ARMS]:
        times: dict[str, list[float]] = {"ours": [], "theirs": []}
        for _ in range(1 if quick else turns):
            times["ours"].append(in_process(ours, name, iterations, env=ONE_THREAD))
            times["theirs"].append(in_process(theirs, name, iterations, env=ONE_THREAD))
        one, other = min(times["ours"]), min(times["theirs"])
        nodes = 200 if name == "acrobot" else NODES
        yield {"robot": name, "nodes": nodes, "ours_ms": one, "theirs_ms": other, "ratio": one / other}


def urdf(name: str, folder: str) -> Path:
    """Write the URDF of an arm without meshes and with its fingers held, and return where."""
    import example_robot_data

    tree = ET.parse(Path(example_robot_data.getModelPath(ARMS[name][0])) / ARMS[name][0])
    for link in tree.getroot().iter("link"):
        for part in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(part)
    for joint in tree.getroot().iter("joint"):
        if joint.get("type") == "prismatic":  # fingers
            joint.set("type", "fixed")
            for part in joint.findall("mimic"):
                joint.remove(part)
    path = Path(folder) / f"{name}.urdf"
    tree.write(path)
    return path


def joints_of(path: Path) -> list[str]:
    """Return the joints that turn, in order."""
    return [
        str(joint.get("name")) for joint in ET.parse(path).getroot().iter("joint") if joint.get("type") == "revolute"
    ]


def ours(name: str, iterations: int) -> float:
    """Return the median time of an iteration [ms] of a second solve."""
    import symphys

    class Enough(BaseException):
        pass

    with TemporaryDirectory() as folder:
        problem = symphys.load("acrobot") if name == "acrobot" else reach(name, urdf(name, folder))
    instants = list[float]()

    def progress(row: Any) -> None:
        instants.append(perf_counter())
        if len(instants) > iterations:
            raise Enough

    for _ in range(2):
        instants.clear()
        with suppress(Enough):
            symphys.solve(problem, "ilqr", threads=1, progress=progress)
    return 1e3 * statistics.median(b - a for a, b in pairwise(instants[1:]))


def reach(name: str, path: Path) -> Any:
    """Return the problem of an arm whose hand shall rest at a place."""
    import symphys

    joints, hand = joints_of(path), ARMS[name][1]
    knots = {"knots": NODES, "interpolation": "constant", "guess": 0.0, "scale": 10.0}
    return symphys.load(
        {
            "include": [{"file": str(path), "base": "fixed", "self_collision": False}],
            "simulation": {"duration": NODES * DT, "dt": DT},
            "variable": [{"name": f"{joint}_torque", "sets": f"{joint}.command", **knots} for joint in joints],
            "cost": [
                {
                    "name": "effort",
                    "at": "always",
                    "squares": f"[{', '.join(f'{joint}.command' for joint in joints)}]",
                    "weight": 1e-4,
                }
            ],
            "target": [
                {"name": "there", "value": f"{hand}.position - {list(PLACE)}", "tolerance": 0.001},
                {"name": "rest", "value": f"[{', '.join(f'{joint}.rate' for joint in joints)}]", "tolerance": 0.01},
            ],
        }
    )


def theirs(name: str, iterations: int) -> float:
    """Return the median time of an iteration [ms] of a second solve."""
    import crocoddyl
    import pinocchio

    with TemporaryDirectory() as folder:
        model = acrobot(pinocchio) if name == "acrobot" else pinocchio.buildModelFromUrdf(str(urdf(name, folder)))
    count, dt, nodes = model.nv, DT, 200 if name == "acrobot" else NODES
    state = crocoddyl.StateMultibody(model)
    motors = crocoddyl.ActuationModelFull(state)

    def action(costs: list[tuple[Any, float]], dt: float) -> Any:
        whole = crocoddyl.CostModelSum(state, motors.nu)
        for number, (residual, weight) in enumerate(costs):
            whole.addCost(str(number), crocoddyl.CostModelResidual(state, residual), weight)
        free = crocoddyl.DifferentialActionModelFreeFwdDynamics(state, motors, whole)
        return crocoddyl.IntegratedActionModelEuler(free, dt)

    control = crocoddyl.ResidualModelControl(state, motors.nu)
    rest = np.zeros(2 * count)
    if name == "acrobot":
        rest[0] = np.pi
        upright = crocoddyl.ResidualModelState(state, rest, motors.nu)
        running, last = action([(control, 0.1), (upright, 1.0)], dt), action([(upright, 100.0)], 0.0)
    else:
        frame = model.getFrameId(ARMS[name][1])
        place = crocoddyl.ResidualModelFrameTranslation(state, frame, np.array(PLACE), motors.nu)
        still = crocoddyl.ResidualModelState(state, rest, motors.nu)
        running, last = action([(control, 1e-4)], dt), action([(place, 1e4), (still, 1.0)], 0.0)
    start = np.concatenate([pinocchio.neutral(model), np.zeros(count)])
    problem = crocoddyl.ShootingProblem(start, [running] * nodes, last)
    instants = list[float]()

    class Clock(crocoddyl.CallbackAbstract):
        def __call__(self, solver: Any) -> None:
            instants.append(perf_counter())

    solver, clock = crocoddyl.SolverFDDP(problem), Clock()
    solver.setCallbacks([clock])
    guess = [np.zeros(motors.nu)] * nodes
    for _ in range(2):
        instants.clear()
        solver.solve(problem.rollout(guess), guess, iterations, False, 1e-9)
    found = 1e3 * statistics.median(b - a for a, b in pairwise(instants[1:]))
    print(f"\n{found}", flush=True)
    os._exit(0)  # the order in which its objects end is not safe


def acrobot(pinocchio: Any) -> Any:
    """Return the links of the shipped acrobot."""
    model, about = pinocchio.Model(), pinocchio.JointModelRY()
    below = pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, -1.0]))
    shoulder = model.addJoint(0, about, pinocchio.SE3.Identity(), "shoulder")
    upper = pinocchio.Inertia(1.0, np.array([0.0, 0.0, -0.5]), np.diag([0.083, 0.083, 0.001]))
    model.appendBodyToJoint(shoulder, upper, pinocchio.SE3.Identity())
    elbow = model.addJoint(shoulder, about, below, "elbow")
    lower = pinocchio.Inertia(1.0, np.array([0.0, 0.0, -1.0]), np.diag([0.33, 0.33, 0.001]))
    model.appendBodyToJoint(elbow, lower, pinocchio.SE3.Identity())
    return model
