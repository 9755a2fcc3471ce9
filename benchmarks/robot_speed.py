"""Steps per second of a robot on the ground, here and in MuJoCo: one alone and 128 side by side, one thread.

Both engines get the same states, after MuJoCo has let the robot fall for half a second, the same time step and no
commands. CPU time is taken in turns, one engine after the other; ratios are within a turn, so that what else the
machine does disturbs both.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from time import perf_counter, process_time

import mujoco
import numpy as np
from mujoco_runs import Runs
from robot_matching import Match
from rolling import Rolling

from symphys.model.state_layout import Layout as Columns
from symphys.model.world import Scheme, World
from symphys.types import Array

BATCH = 128
TURNS = 5
FALLEN = 0.5
"""[s] after which steps are counted."""
WORDS = 12_000_000
"""Of memory for the states of eight lanes, which sets how many steps a call has."""
Call = Callable[[], object]


@dataclass(frozen=True)
class Speed:
    """Robots times steps in a second of CPU time.

    Attributes:
        alone, batch: here, one robot and BATCH.
        there: in MuJoCo, which takes one robot after the other.
        times_alone, times_batch: medians of the ratios to MuJoCo within a turn.
        finite_share: of our numbers in the end.
    """

    alone: float
    batch: float
    there: float
    times_alone: float
    times_batch: float
    finite_share: float


@dataclass(frozen=True)
class Compiled:
    """A robot's steps as a kernel.

    Attributes:
        rolling: some steps in a call.
        seconds: that it took to build and to compile.
        work: the same as CPU time of all processes, which does not depend on what else the machine does.
    """

    rolling: Rolling
    seconds: float
    work: float

    @property
    def steps(self) -> int:
        """Of a call."""
        return self.rolling.steps


def compiled(world: World, scheme: Scheme, steps: int = 50) -> Compiled:
    """At most so many steps in a call, as memory allows."""
    size = Columns(world).size
    began, busy = perf_counter(), cpu_time()
    rolling = Rolling(world, scheme, max(5, min(steps, WORDS // (8 * size))), seeded=())
    _ = rolling.kernel
    return Compiled(rolling, perf_counter() - began, cpu_time() - busy)


def cpu_time() -> float:
    """Of this process and of those that it waited for [s]."""
    return float(sum(os.times()[:4]))


def motion(made: Compiled, x: Array, calls: int) -> Array:
    """(calls + 1, nx): the states after each call, from ``x``."""
    found = [x]
    for _ in range(calls):
        found.append(made.rolling.ends(found[-1][None])[0])
    return np.array(found)


def speed(match: Match, grounded: mujoco.MjModel, made: Compiled, qpos: Array) -> Speed:
    """Of one robot.

    Args:
        match: with the whole world here.
        grounded: MuJoCo's model with contacts, limits and all else.
        made: ours; MuJoCo's time step becomes the same.
        qpos: where the robot begins to fall, MuJoCo's coordinates.
    """
    kernel, steps = made.rolling.kernel, made.steps
    grounded.opt.timestep = made.rolling.scheme.dt
    runs, states = Runs(grounded), fallen(grounded, qpos, grounded.opt.timestep)
    nq, nv = grounded.nq, grounded.nv
    X = np.array([match.x(state[1 : 1 + nq], state[1 + nq : 1 + nq + nv]) for state in states])
    ends = kernel.forward(X, [0.0])["end"]
    few = states[:16]
    calls: list[tuple[Call, int]] = [
        (partial(repeated, partial(kernel.forward, X[:1], [0.0]), 8), 8 * steps),
        (partial(kernel.forward, X, [0.0]), BATCH * steps),
        (partial(runs.after, few, steps), len(few) * steps),
    ]
    times = np.array([[seconds(call) / count for call, count in calls] for _ in range(TURNS + 1)])[1:]
    alone, batch, there = (float(1 / each) for each in times.min(axis=0))
    ratios = np.median(times[:, 2:] / times[:, :2], axis=0)
    return Speed(alone, batch, there, float(ratios[0]), float(ratios[1]), float(np.isfinite(ends).mean()))


def fallen(model: mujoco.MjModel, qpos: Array, dt: float) -> Array:
    """(BATCH, nstate): states of MuJoCo after FALLEN, from the same place with different velocities."""
    rng = np.random.default_rng(5)
    starts = np.zeros((BATCH, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    starts[:, 1 : 1 + model.nq] = qpos
    starts[:, 1 + model.nq : 1 + model.nq + model.nv] = rng.normal(0, 0.1, (BATCH, model.nv))
    return Runs(model).after(starts, round(FALLEN / dt))[:, -1]


def repeated(call: Call, count: int) -> None:
    """The same several times."""
    for _ in range(count):
        call()


def seconds(call: Call) -> float:
    """CPU time of this process."""
    began = process_time()
    call()
    return process_time() - began
