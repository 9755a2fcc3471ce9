"""A robot in free motion, here and in MuJoCo from the same state: how far apart, and of which order in the step.

MuJoCo's own Runge-Kutta of fourth order at a tenth of a millisecond or less stands for the truth. Joints keep their
springs, dampers and armatures; contacts, motors, limits and dry friction are off in both.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import mujoco
import numpy as np
from mujoco_runs import Runs
from robot_matching import Match, unforced

from symphys.dynamics.functions import step_function
from symphys.model.state_layout import Layout
from symphys.model.world import Scheme
from symphys.types import Array

FINE = (1e-4, 2.5e-5, 6.25e-6, 1.5625e-6)
"""[s], of MuJoCo: the first one that the next one confirms; dampers of light links need small ones."""
CONFIRMED = 1e-9
"""[rad], [m]: two of them agree so far."""
STEPS = (0.004, 0.002, 0.001, 0.0005, 0.00025, 0.000125)
"""[s]; the last ones where the first do not show the order."""
ROUNDING = 3e-10
"""[m]: errors below it have no order."""
DURATIONS = (0.5, 0.1)
"""[s]: the second where the first leads a robot through poses in which its mass matrix is singular."""
RELAXED = 0.1
"""[s] of MuJoCo's motion before the comparison begins: in which dampers of light links take what no step resolves."""
BATCH = 3


@dataclass(frozen=True)
class Agreement:
    """What free motion shows.

    Attributes:
        duration: [s].
        steps: [s].
        errors: [m], one for each: median over initial states of the root mean square over bodies.
        order: of the last two.
    """

    duration: float
    steps: tuple[float, ...]
    errors: tuple[float, ...]

    @property
    def order(self) -> float | None:
        """Of the last two; None where there are only errors of rounding."""
        return None if self.errors[-1] < ROUNDING else float(np.log2(self.errors[-2] / self.errors[-1]))


def agreement(match: Match, speed: float = 1.0, batch: int = BATCH) -> Agreement:
    """As long as MuJoCo's motion can be relied upon. RuntimeError where it cannot at all."""
    for duration in DURATIONS[:-1]:
        try:
            return agreement_after(match, duration, speed, batch)
        except RuntimeError:
            continue
    return agreement_after(match, DURATIONS[-1], speed, batch)


def agreement_after(match: Match, duration: float, speed: float = 1.0, batch: int = BATCH) -> Agreement:
    """Steps are halved until the errors fall as their square, but no further than ``STEPS``."""
    world = unforced(match.world)
    rng = np.random.default_rng(3)
    states = [there(match, *match.random(rng, speed), RELAXED) for _ in range(batch)]
    exact = [match.state(*there(match, *state, duration)) for state in states]
    truth = np.array([[values[f"{body.name}.position"] for body in world.bodies] for values in exact])
    X = np.array([match.x(*state, world) for state in states])
    layout = Layout(world)
    columns = [layout[f"{body.name}.position"] for body in world.bodies]
    dt = ca.SX.sym("dt")
    step = step_function(world, Scheme(dt=dt, cuts=0), parameters=[dt])
    found: list[float] = []
    for k, size in enumerate(STEPS):
        ends = rolled(step, X, size, round(duration / size))
        places = np.stack([ends[:, part] for part in columns], axis=1)
        found.append(float(np.median(np.sqrt(((places - truth) ** 2).sum(axis=-1).mean(axis=-1)))))
        if k >= 2 and (found[-1] < ROUNDING or abs(np.log2(found[-2] / found[-1]) - 2) < 0.05):
            break
    return Agreement(duration, STEPS[: len(found)], tuple(found))


def rolled(step: ca.Function, X: Array, dt: float, count: int) -> Array:
    """(batch, nx): the states after ``count`` steps."""
    found = []
    for x in X:
        state = ca.DM(x)
        for _ in range(count):
            state = step(state, ca.DM(0, 1), dt, 0)
        found.append(np.array(state).ravel())
    return np.array(found)


def there(match: Match, qpos: Array, qvel: Array, duration: float) -> tuple[Array, Array]:
    """Where MuJoCo has the robot in the end: coordinates and velocities. RuntimeError where no step is confirmed."""
    model, ends = match.model, list[Array]()
    start = np.zeros((1, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    start[0, 1 : 1 + model.nq], start[0, 1 + model.nq : 1 + model.nq + model.nv] = qpos, qvel
    for dt in FINE:
        model.opt.timestep = dt
        ends.append(Runs(model).last(start, round(duration / dt))[0])
        if len(ends) > 1 and np.abs(ends[-1][1 : 1 + model.nq] - ends[-2][1 : 1 + model.nq]).max() < CONFIRMED:
            return ends[-1][1 : 1 + model.nq], ends[-1][1 + model.nq : 1 + model.nq + model.nv]
    raise RuntimeError("MuJoCo's steps are not confirmed by smaller ones")
