"""The quadruped's periodic gait in MuJoCo, searched by CMA-ES: open loop, one robot, its own contacts and servos."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import cma
import mujoco
import numpy as np
from mujoco import rollout
from race import MARKS, Course

from symphys.codegen import processors
from symphys.export import mjcf
from symphys.problem import Problem, load_problem
from symphys.problems import find
from symphys.types import Array

SIGMA, FALLEN = 0.05, 0.5
DT = 0.002
"""[s]: at 5 and 10 ms the stiff servos of our exporter are not stable there."""
PARTS = ("frequency", "offsets", "sines", "cosines")


class Gaits:
    """Rollouts of gaits z = (frequency / 2 Hz, offsets, sines, cosines), each as the shipped problem rates it."""

    def __init__(self, problem: Problem) -> None:
        """Export the robot, with rigid feet, which are what MuJoCo's exporter knows."""
        world = problem.world()
        pairs = tuple(replace(pair, law=replace(pair.law, frequency=0.0)) for pair in world.pairs)
        self.dt, self.steps = DT, round(problem.simulation.duration / DT)
        text = mjcf(replace(world, pairs=pairs), problem.initial, self.dt, problem.name)
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = [mujoco.MjData(self.model) for _ in range(processors())]
        self.state = np.concatenate([[0.0], self.model.key_qpos[0], self.model.key_qvel[0]])
        gait = next(controller for controller in problem.controllers if controller.name == "gait")
        joints = [name.removesuffix(".command") for name, _ in gait.drives]
        self.order = [joints.index(self.model.actuator(k).name) for k in range(self.model.nu)]
        parts = [problem.weights[f"gait.{part}"] for part in PARTS]
        self.start = np.concatenate([parts[0] / 2, *parts[1:]])

    def commands(self, Z: Array) -> Array:
        """(batch, steps, 16) of the servos."""
        time = np.arange(self.steps) * self.dt
        offsets, sines, cosines = (Z[:, None, 1 + 16 * k : 17 + 16 * k] for k in range(3))
        phase = 2 * np.pi * (2 * Z[:, :1] * time)[:, :, None]
        return np.asarray((offsets + sines * np.sin(phase) + cosines * np.cos(phase))[:, :, self.order])

    def __call__(self, Z: Array) -> tuple[Array, Array]:
        """(batch,) costs as in the problem, effort aside, and speed [m/s]; a fall leaves none."""
        states, _ = rollout.rollout(self.model, self.data, self.state[None], self.commands(Z), persistent_pool=True)
        p, q, v, w = (states[:, :, a:b] for a, b in ((1, 4), (4, 8), (24, 27), (27, 30)))
        up = 1 - 2 * (q[..., 1] ** 2 + q[..., 2] ** 2)
        ahead = 2 * (q[..., 1] * q[..., 2] + q[..., 0] * q[..., 3])
        alive = np.cumprod(np.minimum(up - 0.6, p[..., 2] - 0.25) > 0, axis=1).astype(bool)
        cost = np.maximum(2.3 - v[..., 0], 0) + 5 * (1 - up) + 20 * np.maximum(0.95 - up, 0)
        cost += 20 * np.maximum(0.45 - p[..., 2], 0) ** 2 + 0.2 * p[..., 1] ** 2 + 0.5 * ahead**2
        cost += 0.2 * v[..., 1] ** 2 + 0.1 * v[..., 2] ** 2 + 0.03 * (w**2).sum(axis=2)
        total = 0.1 * self.dt * np.where(alive, cost, 0).sum(axis=1) + FALLEN * self.dt * (~alive).sum(axis=1)
        total = np.where(np.isfinite(total), total, 10 * FALLEN)
        return total, np.where(alive[:, -1], p[:, -1, 0] / (self.steps * self.dt), 0.0)


def raced_there(seed: int, seconds: float) -> Course:
    """CMA-ES for so long; what is kept is the best gait so far."""
    gaits = Gaits(load_problem(find("quadruped_walk")))
    options = {"seed": seed + 1, "verbose": -9, "verb_log": 0}
    search = cma.CMAEvolutionStrategy(gaits.start, SIGMA, options)
    began, best, kept, rows = perf_counter(), np.inf, 0.0, []
    robots = 0
    while perf_counter() - began < seconds:
        Z = np.array(search.ask())
        costs, speeds = gaits(Z)
        search.tell(list(Z), costs.tolist())
        robots += len(Z)
        if costs.min() < best:
            best, kept = float(costs.min()), float(speeds[costs.argmin()])
        rows.append((perf_counter() - began, kept))
    course = Course("CMA-ES with MuJoCo, no feedback", *np.array(rows).T)
    rate = robots * gaits.steps / course.seconds[-1]
    marks = ", ".join(f"{mark} m/s after {course.reaches(mark):.0f} s" for mark in MARKS)
    print(f"{course.name} seed {seed}: {marks}; {kept:.2f} m/s at the end; {rate:.3g} steps per second", flush=True)
    return course
