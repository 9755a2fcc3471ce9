"""Gaits that Gymnasium's models learned here: speed, the reward of Gymnasium, and the same controllers in MuJoCo.

``python benchmarks/imported_gaits.py FOLDER`` (``make bench-gaits``) solves the four shipped problems into that folder,
where it goes on if it was stopped, then measures what the run folders hold:

- speed over the 4 s that were learned, and over 1,000 steps of Gymnasium, here;
- the reward of those by the formulas of HalfCheetah-v5, Hopper-v5, Walker2d-v5 and Ant-v5, without the cost of contact
  forces; commands change within a step of Gymnasium, so that their squares are means over it;
- the same controllers in MuJoCo with the model as its package has it, from the same start: they sense MuJoCo's state in
  every time step of the problem. How long it stays up, its speed and reward.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import mujoco
import numpy as np
from robot_matching import Match

import symphys
from symphys.dynamics.observation import SensedState, named_sensors, sensor_readings
from symphys.importing.packages import model_file
from symphys.model.state_layout import Layout, initial_state
from symphys.types import Array

STEPS = 1000
"""Of Gymnasium, the length of an episode."""


@dataclass(frozen=True)
class Task:
    """A task of Gymnasium.

    Attributes:
        problem: shipped here.
        model: in the package.
        step: [s], for which a command holds there.
        alive: bonus of a step while ``up``.
        effort: weight of the squared commands.
        up: least and largest height [m] of the torso's frame, and largest pitch [rad], with which it counts as healthy.
    """

    problem: str
    model: str
    step: float
    alive: float
    effort: float
    up: tuple[float, float, float]


TASKS = (
    Task("half_cheetah_run", "half_cheetah", 0.05, 0.0, 0.1, (-np.inf, np.inf, np.inf)),
    Task("hopper_run", "hopper", 0.008, 1.0, 1e-3, (0.7, np.inf, 0.2)),
    Task("walker2d_walk", "walker2d_v5", 0.008, 1.0, 1e-3, (0.8, 2.0, 1.0)),
    Task("ant_walk", "ant", 0.05, 1.0, 0.5, (0.2, 1.0, np.inf)),
)


@dataclass(frozen=True)
class Course:
    """What a gait did over n instants.

    Attributes:
        time: (n,) [s].
        x, height: (n,) of the torso's frame [m].
        pitch: (n,) of it [rad].
        commands: (n - 1, m), within their range.
    """

    time: Array
    x: Array
    height: Array
    pitch: Array
    commands: Array

    def up(self, task: Task) -> int:
        """How many of the instants pass before it falls, as the task has it."""
        low, high, tilt = task.up
        fallen = (self.height < low) | (self.height > high) | (np.abs(self.pitch) > tilt)
        return int(np.argmax(fallen)) if fallen.any() else len(fallen)

    def rated(self, task: Task) -> tuple[float, float, float]:
        """(seconds that it stays up, mean speed [m/s] and Gymnasium's reward until then)."""
        last = max(self.up(task) - 1, 1)
        seconds = float(self.time[last] - self.time[0])
        efforts = (self.commands[:last] ** 2).sum(axis=1)
        steps = seconds / task.step
        speed = float(self.x[last] - self.x[0]) / seconds
        return seconds, speed, steps * (speed + task.alive - task.effort * float(efforts.mean()))


class Gait:
    """The controllers of a solution, and what they drive."""

    def __init__(self, solution: symphys.Solution) -> None:
        """Compile what they do with a state."""
        self.problem = solution.problem
        self.world = self.problem.world()
        numbers = {**self.problem.weights}
        for variable in self.problem.variables:
            for slot in variable.slots:
                numbers[slot.name] = np.asarray(solution.value[variable.name], float).ravel()
        x, time = ca.SX.sym("x", Layout(self.world).size), ca.SX.sym("time")
        read = sensor_readings(SensedState(self.world, x), named_sensors(self.world))
        names: dict[str, Any] = {"time": time, **read}
        sensed = {
            each.name: ca.vertcat(*(part.evaluate({n: names[n] for n in part.names}) for part in each.formulas))
            for each in self.problem.sensors
        }
        self.motors = [joint for joint in self.world.joints if joint.driven]
        places = {f"{joint.name}.command": k for k, joint in enumerate(self.motors)}
        total = [ca.SX(0)] * len(self.motors)
        for controller in self.problem.controllers:
            own = {key: ca.DM(numbers[f"{controller.name}.{key}"]) for key in controller.law.sizes}
            seen = ca.vertcat(ca.SX(0, 1), *(sensed[name] for name in controller.senses))
            given = controller.law.act(seen, time, own)
            for k, ((name, _), scale) in enumerate(zip(controller.drives, controller.scale, strict=True)):
                total[places[name]] += float(scale) * given[k]
        self.act = ca.Function("act", [x, time], [ca.vertcat(*total)])

    def commands(self, values: Any, time: float) -> Array:
        """(m,) in a state, held within the range of the motors."""
        found = np.array(self.act(initial_state(self.world, values), time)).ravel()
        low, high = np.array([joint.motor.command_range for joint in self.motors]).T
        return np.asarray(np.clip(found, low, high))


def here(solution: symphys.Solution, gait: Gait, task: Task, match: Match) -> Course:
    """The gait for an episode, in the world that it was learned in."""
    problem = gait.problem.set("simulation.duration", STEPS * task.step)
    values = {variable.name: np.asarray(solution.value[variable.name]) for variable in problem.variables}
    motion = symphys.simulate(problem, values)
    commands = np.stack([np.asarray(motion[f"{joint.name}.command"]).ravel() for joint in gait.motors], axis=1)
    low, high = np.array([joint.motor.command_range for joint in gait.motors]).T
    arm = offset(match)
    frames = [framed(motion["torso.position"][k], motion["torso.orientation"][k], arm) for k in range(len(motion.time))]
    x, height, pitch = np.array(frames).T
    return Course(motion.time, x, height, pitch, np.clip(commands, low, high))


def there(gait: Gait, task: Task, match: Match, qpos: Array) -> Course:
    """The gait for an episode in MuJoCo, with contacts, limits and actuators of the untouched model."""
    model = mujoco.MjModel.from_xml_path(str(model_file(f"package://gymnasium/envs/mujoco/assets/{task.model}.xml")))
    data, dt, arm = mujoco.MjData(model), gait.problem.simulation.dt, offset(match)
    data.qpos[:] = qpos
    order = [actuator_of(model, match.joints[joint.name]) for joint in gait.motors]
    inner, rows, given = max(1, round(dt / model.opt.timestep)), [], []
    for k in range(round(STEPS * task.step / dt) + 1):
        values = match.state(data.qpos.copy(), data.qvel.copy())
        rows.append(framed(values["torso.position"], values["torso.orientation"], arm))
        given.append(gait.commands(values, k * dt))
        data.ctrl[order] = given[-1]
        mujoco.mj_step(model, data, inner)
    x, height, pitch = np.array(rows).T
    return Course(dt * np.arange(len(rows)), x, height, pitch, np.array(given[:-1]))


def offset(match: Match) -> Array:
    """(3,) from the torso's centre of mass to the origin of its frame in MuJoCo, body frame [m]."""
    model, data = match.model, match.data
    data.qpos[:] = model.qpos0
    mujoco.mj_kinematics(model, data)
    values = match.state(model.qpos0.copy(), np.zeros(model.nv))
    axes = data.xmat[match.bodies["torso"]].reshape(3, 3)
    return np.asarray(axes.T @ (data.xpos[match.bodies["torso"]] - np.array(values["torso.position"], float).ravel()))


def framed(position: Any, orientation: Any, arm: Array) -> tuple[float, float, float]:
    """x and height of a body's origin [m], and its pitch [rad]."""
    w, i, j, k = np.array(orientation, float).ravel()
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, np.array([w, i, j, k]))
    axes = turn.reshape(3, 3)
    place = np.array(position, float).ravel() + axes @ arm
    return float(place[0]), float(place[2]), float(np.arctan2(-axes[2, 0], axes[2, 2]))


def actuator_of(model: mujoco.MjModel, joint: int) -> int:
    """The actuator that drives a joint."""
    return next(k for k in range(model.nu) if model.actuator_trnid[k][0] == joint)


def started(gait: Gait, match: Match) -> Array:
    """MuJoCo's coordinates where the gait begins here."""
    qpos = match.model.qpos0.copy()
    motion = symphys.simulate(gait.problem.set("simulation.duration", gait.problem.simulation.dt))
    for name, j in match.joints.items():
        key = f"{name}.angle" if match.model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE else f"{name}.position"
        q = match.model.jnt_qposadr[j]
        qpos[q] = match.model.qpos0[q] + np.asarray(motion[key]).ravel()[0]
    if match.roots:
        low = np.asarray(motion["torso.position"])[0]
        qpos[:3] = low + np.array(match.data.xmat[match.bodies["torso"]]).reshape(3, 3) @ offset(match)
    return np.asarray(qpos)


def row(task: Task, folder: Path) -> str:
    """The line of a gait."""
    solution = symphys.read(folder)
    gait = Gait(solution)
    path = model_file(f"package://gymnasium/envs/mujoco/assets/{task.model}.xml")
    match = Match(gait.world, gait.world.start, mujoco.MjModel.from_xml_path(str(path)))
    own = here(solution, gait, task, match)
    theirs = there(gait, task, match, started(gait, match))
    learned = next(iter(solution.outputs.values()))
    (a, b, c), (d, e, f) = own.rated(task), theirs.rated(task)
    episode = STEPS * task.step
    return (
        f"| {task.problem} | {learned:.2f} | {a:.1f} of {episode:g} | {b:.2f} | {c:.0f} "
        f"| {d:.1f} of {episode:g} | {e:.2f} | {f:.0f} |"
    )


def main() -> None:
    """Solve, then print the table."""
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "build/gaits")
    for task in TASKS:
        command = [sys.executable, "-P", "-m", "symphys", "solve", task.problem, "--out", str(out), "--no-report"]
        subprocess.run([*command, "--unexamined"], check=True)
    print("| problem | learned m/s | up [s] | m/s | reward | in MuJoCo: up [s] | m/s | reward |")
    print("|---|---|---|---|---|---|---|---|")
    for task in TASKS:
        print(row(task, out / task.problem / "evolution-seed0"), flush=True)


if __name__ == "__main__":
    main()
