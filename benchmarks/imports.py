"""Are robots of other people after import what MuJoCo reads: masses, free motion, a fall?

56 models of gymnasium, dm_control's suite and URDF files of example-robot-data, as far as these are installed. Masses,
centres and mass matrices are compared at random poses. Free motion, from the same state with springs, dampers and
armatures but without contacts, motors, limits and dry friction, is compared with MuJoCo's Runge-Kutta of fourth order
at 0.1 ms or less; its error falls with the square of the step. Each model is compiled, with an empty cache, and falls
for a second.

"""

from __future__ import annotations

import resource
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple

import casadi as ca
import mujoco
import numpy as np
from bench import Row, in_process, spent
from engines import Rolling, Runs
from imported_models import Imported, Match, all_models, begin, imported, matched, unforced

from symphys.dynamics.functions import step_function
from symphys.errors import install_advice
from symphys.model.state_layout import Layout, initial_state
from symphys.model.world import Scheme
from symphys.types import Array

COLUMNS = {
    "model": "package and name",
    "bodies": "with mass",
    "dof": "degrees of freedom",
    "motors": "joints that are driven",
    "contacts": "pairs of shapes that may touch",
    "own_contacts": "whether bodies of the robot may touch each other",
    "left_out": "parts of the file that are not imported",
    "mass": "largest relative difference of the mass",
    "centre": "largest difference of the centre of mass [m]",
    "matrix": "largest difference of mass matrices by their largest entry",
    "error": "of free motion at a step of 2 ms [m]",
    "order": "of the error, from the two smallest steps",
    "compile_cpu_s": "seconds of processors to build and to compile the steps",
    "start_off": "difference of the problem's start from the model's [m, rad]",
    "fastest": "fastest body in a second on the ground [m/s]",
    "fault": "what failed",
}
POSES = 5
MOST_POINTS = 120
"""Models with more contacts are measured without those between their own bodies."""
SECONDS, GIGABYTES = 300, 12
"""Limits of the process of one model."""
WORDS = 12_000_000
"""Most words of memory for the states of eight lanes of a kernel."""
FINE = (1e-4, 2.5e-5, 6.25e-6, 1.5625e-6)
"""Steps of MuJoCo [s]: the first that the next one confirms counts; dampers of light links need small ones."""
CONFIRMED = 1e-9
"""Difference of two of them that confirms [rad, m]."""
STEPS = (0.004, 0.002, 0.001, 0.0005, 0.00025, 0.000125)
"""Steps [s]; the last ones are taken where the first do not show the order."""
ROUNDING = 3e-10
"""Errors below it have no order [m]."""
DURATIONS = (0.5, 0.1)
"""Durations [s]: the second counts where the first leads through poses with a singular mass matrix."""
RELAXED = 0.1
"""MuJoCo's motion before the comparison [s], in which dampers of light links take what no step resolves."""
BATCH = 3


def rows(quick: bool = False, models: tuple[str, ...] = ()) -> Iterator[Row]:
    """Yield a row for each model.

    Args:
        quick: masses of the ant.
        models: names such as gymnasium/ant; none: all that are installed.
    """
    found = [model.name for model in all_models()]
    if not found:
        raise SystemExit(f"no models: {install_advice('models')}")
    if quick:
        yield measure(models[0] if models else "gymnasium/ant", True)
        return
    for name in models or found:
        yield apart(measure, name, False)


def apart(function: Callable[..., Row], name: str, *arguments: bool) -> Row:
    """Measure one model in a process of its own with an empty cache of kernels and limits of time and memory."""
    with tempfile.TemporaryDirectory() as cache:
        try:
            return dict(in_process(function, name, *arguments, env={"SYMPHYS_CACHE": cache}, timeout=SECONDS))
        except (RuntimeError, subprocess.TimeoutExpired) as error:
            return {"model": name, "fault": str(error)[-200:]}


def measure(name: str, quick: bool) -> Row:
    """Measure everything about one model; what fails is named in the row, and the rest goes on."""
    resource.setrlimit(resource.RLIMIT_AS, (GIGABYTES << 30, GIGABYTES << 30))
    mujoco.set_mju_user_warning(lambda text: None)
    model = next(each for each in all_models() if each.name == name)
    robot = imported(model)
    own = len(robot.problem.world().pairs) <= MOST_POINTS
    robot = robot if own else imported(model, self_collision=False)
    world, faults = robot.problem.world(), list[str]()
    match = matched(world, robot.placed, model.reference())
    row: Row = {
        "model": name,
        "bodies": sum(float(body.mass) > 0 for body in world.bodies),
        "dof": match.model.nv,
        "motors": sum(joint.driven for joint in world.joints),
        "contacts": len(world.pairs),
        "own_contacts": own,
        "left_out": sum(each.kind == "left out" for each in robot.findings),
    }
    parts: tuple[Callable[[], Row], ...] = (lambda: same_data(match),)
    if not quick:
        parts += (lambda: free_motion(match), lambda: falls(robot, match, begin(match, robot)))
    for part in parts:
        try:
            row |= part()
        except Exception as error:  # the row names what failed
            faults.append(f"{type(error).__name__}: {error}"[:200])
    return row | {"fault": "; ".join(faults) or None}


def same_data(match: Match) -> Row:
    """Compare masses, centres and mass matrices at random poses; returns the largest differences."""
    rng, masses, centres, matrices = np.random.default_rng(0), [], [], []
    for _ in range(POSES):
        qpos, _ = match.random(rng)
        here, place_here, there, place_there = match.centres(qpos)
        masses.append(abs(here / there - 1))
        centres.append(float(np.abs(place_here - place_there).max()))
        matrix = match.mass_matrix_there(qpos)
        matrices.append(float(np.abs(match.mass_matrix(qpos) - matrix).max() / np.abs(matrix).max()))
    return {"mass": max(masses), "centre": max(centres), "matrix": max(matrices)}


def free_motion(match: Match) -> Row:
    """Return the error of free motion and its order."""
    found = agreement(match)
    return {"error": found.errors[found.steps.index(0.002)], "order": found.order}


def falls(robot: Imported, match: Match, qpos: Array) -> Row:
    """Compile the steps and let the robot fall for a second."""
    world, scheme, began = match.world, robot.problem.simulation.scheme(), spent()
    layout = Layout(world)
    rolling = Rolling(world, scheme, max(5, min(50, WORDS // (8 * layout.size))), seeded=())
    _ = rolling.kernel
    work, x = spent() - began, match.x(qpos, np.zeros(match.model.nv))
    known, fastest = np.array(ca.DM(initial_state(world, robot.problem.initial))).ravel(), 0.0
    off = float(np.abs(x - known).max())
    for _ in range(max(1, round(1 / (scheme.dt * rolling.steps)))):
        x = rolling.ends(x[None])[0]
        speeds = [float(np.linalg.norm(x[layout[f"{body.name}.velocity"]])) for body in world.bodies]
        fastest = max(fastest, *speeds)
    return {"compile_cpu_s": work, "start_off": off, "fastest": fastest}


class Agreement(NamedTuple):
    """Errors of free motion against MuJoCo's: rms over bodies [m], the median of initial states, by time steps [s]."""

    steps: tuple[float, ...]
    errors: tuple[float, ...]

    @property
    def order(self) -> float | None:
        """Return the order of the last two errors; None where there are only errors of rounding."""
        return None if self.errors[-1] < ROUNDING else float(np.log2(self.errors[-2] / self.errors[-1]))


def agreement(match: Match) -> Agreement:
    """Compare free motion as long as MuJoCo's can be relied upon; RuntimeError where it never can."""
    with suppress(RuntimeError):
        return agreement_after(match, DURATIONS[0])
    return agreement_after(match, DURATIONS[1])


def agreement_after(match: Match, duration: float, speed: float = 1.0, batch: int = BATCH) -> Agreement:
    """Halve steps until the errors fall as their square, but no further than ``STEPS``."""
    world = unforced(match.world)
    rng = np.random.default_rng(3)
    states = [moved_there(match, *match.random(rng, speed), RELAXED) for _ in range(batch)]
    exact = [match.state(*moved_there(match, *state, duration)) for state in states]
    truth = np.array([[values[f"{body.name}.position"] for body in world.bodies] for values in exact])
    X = np.array([match.x(*state, world) for state in states])
    layout = Layout(world)
    columns = [layout[f"{body.name}.position"] for body in world.bodies]
    dt = ca.SX.sym("dt")
    step = step_function(world, Scheme(dt=dt, cuts=0), parameters=[dt])
    found: list[float] = []
    for k, size in enumerate(STEPS):
        ends = np.array([rolled(step, x, (size,), round(duration / size)) for x in X])
        places = np.stack([ends[:, part] for part in columns], axis=1)
        found.append(float(np.median(np.sqrt(((places - truth) ** 2).sum(axis=-1).mean(axis=-1)))))
        if k >= 2 and (found[-1] < ROUNDING or abs(np.log2(found[-2] / found[-1]) - 2) < 0.05):
            break
    return Agreement(STEPS[: len(found)], tuple(found))


def rolled(step: ca.Function, x: Array, parameters: Sequence[float], count: int) -> Array:
    """Return the state (nx,) after ``count`` steps."""
    state = ca.DM(x)
    for _ in range(count):
        state = step(state, ca.DM(0, 1), ca.DM(parameters) if parameters else ca.DM(0, 1), 0)
    return np.array(state).ravel()


def moved_there(match: Match, qpos: Array, qvel: Array, duration: float) -> tuple[Array, Array]:
    """Return MuJoCo's coordinates and velocities in the end; RuntimeError where no step is confirmed."""
    model, ends = match.model, list[Array]()
    start = np.zeros((1, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    start[0, 1 : 1 + model.nq], start[0, 1 + model.nq : 1 + model.nq + model.nv] = qpos, qvel
    for dt in FINE:
        model.opt.timestep = dt
        ends.append(Runs(model).last(start, round(duration / dt))[0])
        if len(ends) > 1 and np.abs(ends[-1][1 : 1 + model.nq] - ends[-2][1 : 1 + model.nq]).max() < CONFIRMED:
            return ends[-1][1 : 1 + model.nq], ends[-1][1 + model.nq : 1 + model.nq + model.nv]
    raise RuntimeError("MuJoCo's steps are not confirmed by smaller ones")
