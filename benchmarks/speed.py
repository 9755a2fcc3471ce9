"""How many steps and derivatives a second does one core take, against MuJoCo?

A quadruped on its four feet (17 bodies, 16 hinges), one ball that bounces, and 16 balls in a box. MuJoCo gets the robot
by our exporter, the same initial states and the same time step. Processor time is taken in turns, one engine after the
other; ratios are within a turn, so that what else the machine does disturbs both. MuJoCo's derivative,
``mjd_transitionFD``, gives the whole matrices of a step by state and command; ours, the adjoint of the whole rollout,
gives the gradient of one number.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from time import process_time

import mujoco
import numpy as np
from bench import Call, Row, all_turns
from engines import Rolling, Runs, robot_model, robot_states
from measured_worlds import HALF, WALLS, balls_in_a_box, box_starts
from robots import HELD, JointedScene, standing

from symphys.codegen import compile_program
from symphys.model.world import Scheme
from symphys.transcription import rollout_program
from symphys.transcription.rollout import symbolic_rollout
from symphys.types import Array

DT, STEPS, BATCH = 0.01, 50, 128
DERIVED = 16
"""Robots whose steps are differentiated in MuJoCo, each STEPS times."""
SPREAD = 0.3
"""Between the velocities of balls in a batch [m/s], so that no two of its scenes have the same contacts."""
COLUMNS = {
    "scene": "what moves, at a step of 10 ms",
    "engine": "its settings, and instances in a call",
    "thousand_steps_s": "10^3 steps a second of processor time, best turn",
    "times_steps": "median ratio to MuJoCo in a turn",
    "thousand_derivatives_s": "10^3 derivatives of a step a second of processor time, best turn",
    "times_derivatives": "median ratio to MuJoCo in a turn",
}


@dataclass(frozen=True)
class Candidate:
    """Something that is measured.

    Attributes:
        name: of the engine and its settings.
        rollout: a call that takes steps.
        steps: of the call, times instances.
        derivative: a call that differentiates steps, if it is measured.
        derived: steps that it differentiates, times instances.
    """

    name: str
    rollout: Call
    steps: int
    derivative: Call | None = None
    derived: int = 1


def rows(quick: bool = False, turns: int = 7) -> Iterator[Row]:
    """Yield each engine on each scene; the last engine of a scene is MuJoCo with our law of friction."""
    for scene in ("bounce",) if quick else ("bounce", "box"):
        yield from compared(scene, balls(scene, 2 if quick else BATCH), 1 if quick else turns)
    if quick:
        return
    for name, (motor, integrator) in HELD.items():
        robot = standing(motor)
        ours = [here(robot, sweeps, BATCH) for sweeps in (20, 10, 5)]
        alone = [here(robot, 20, 1, calls) for calls in (1, BATCH)]
        theirs = [there(robot, integrator, cone) for cone in ("pyramidal", "elliptic")]
        yield from compared(f"quadruped held by {name}", [*ours, *alone, *theirs], turns)


def compared(scene: str, candidates: Sequence[Candidate], turns: int) -> Iterator[Row]:
    """Yield a row for each candidate; a first turn does not count."""
    calls: dict[tuple[int, str], Call] = {}
    for k, each in enumerate(candidates):
        calls[k, "steps"] = each.rollout
        if each.derivative is not None:
            calls[k, "derivatives"] = each.derivative
    found = all_turns(calls, turns + 1, process_time)  # type: ignore[type-var, arg-type]
    times: dict[tuple[int, str], Array] = {}
    for (k, what), seconds in found.items():  # type: ignore[misc]
        count = candidates[k].steps if what == "steps" else candidates[k].derived
        times[k, what] = np.array(seconds[1:]) / count
    last = len(candidates) - 1
    for k, each in enumerate(candidates):
        row: Row = {"scene": scene, "engine": each.name}
        for what in ("steps", "derivatives"):
            own = times.get((k, what))
            row[f"thousand_{what}_s"] = None if own is None else 1e-3 / float(own.min())
            row[f"times_{what}"] = None if own is None else float(np.median(times[last, what] / own))
        yield row


def here(scene: JointedScene, sweeps: int, batch: int, calls: int = 1, steps: int = STEPS) -> Candidate:
    """Return this engine on a robot; ``calls``: batches one after the other, some of which are differentiated."""
    world = scene.world()
    kernel = Rolling(world, Scheme(dt=DT, sweeps=sweeps, cuts=0), steps, rows=batch).kernel
    states = np.split(scene.states(world)[: batch * calls], calls)
    seed = np.eye(states[0].shape[1])[0]
    derived = states[:DERIVED]

    def rollout() -> None:
        for each in states:
            kernel.forward(each, [0.0])

    def derivative() -> None:
        for each in derived:
            kernel.gradient(each, seed, [0.0])

    name = f"symphys, {sweeps} sweeps, {calls} call{'s' if calls > 1 else ''} of {batch}"
    return Candidate(name, rollout, calls * batch * steps, derivative, len(derived) * batch * steps)


def there(scene: JointedScene, integrator: str, cone: str, steps: int = STEPS) -> Candidate:
    """Return MuJoCo on a robot."""
    runs, states = Runs(robot_model(scene, DT, integrator, cone)), robot_states(scene)
    derived = states[:DERIVED]
    return Candidate(
        f"MuJoCo, {integrator}, {cone}",
        partial(runs.after, states, steps),
        len(states) * steps,
        partial(differentiate, runs, derived, steps),
        len(derived) * steps,
    )


def differentiate(runs: Runs, states: Array, steps: int) -> None:
    """Take every step of these rollouts with its matrices by one-sided differences."""
    model, data = runs.model, runs.data
    n = 2 * model.nv + model.na
    a, b = np.zeros((n, n)), np.zeros((n, model.nu))
    for state in states:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = state[1 : 1 + model.nq], state[1 + model.nq :]
        for _ in range(steps):
            mujoco.mjd_transitionFD(model, data, 1e-6, False, a, b, None, None)
            mujoco.mj_step(model, data)


def balls(scene: str, batch: int) -> list[Candidate]:
    """Return both engines on balls; MuJoCo's contact gives back about 0.7 of the speed."""
    _, velocities, duration = box_starts(scene)
    program, z = rollout_program(symbolic_rollout(balls_in_a_box(scene, DT)), exact=True), velocities.ravel()
    steps = round(duration / DT)
    found = []
    for count in (1, batch):
        Z = z + (SPREAD if count > 1 else 0) * np.random.default_rng(1).standard_normal((count, len(z)))
        kernel = compile_program(program, threads=1, rows=count if count == 1 else None)
        found.append(Candidate(f"symphys, 1 call of {count}", partial(kernel.forward, Z, [0.0]), count * steps))
    model = balls_there(scene)
    rollout = partial(bounced, model, mujoco.MjData(model), velocities, steps)
    return [*found, Candidate("MuJoCo, defaults", rollout, steps)]


def balls_there(scene: str) -> mujoco.MjModel:
    """Return MuJoCo's model of the balls."""
    contact = 'friction="0.3 0 0" solref="-20000 -45" priority="0"'
    walls = ""
    for x, y in WALLS.values() if scene == "box" else ():
        euler = f"0 {90 * x} 0" if x else f"{-90 * y} 0 0"
        place = f"{-HALF * x} {-HALF * y} 0"
        walls += f'<geom type="plane" size="2 2 .1" pos="{place}" euler="{euler}" {contact}/>'
    bodies = "".join(
        f'<body pos="{x} {y} {z}"><freejoint/><geom type="sphere" size="0.1" mass="1" {contact}/></body>'
        for x, y, z in box_starts(scene)[0]
    )
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="degree"/><option timestep="{DT}"/><worldbody>'
        f'<geom type="plane" size="5 5 .1" {contact}/>{walls}{bodies}</worldbody></mujoco>'
    )


def bounced(model: mujoco.MjModel, data: mujoco.MjData, velocities: Array, steps: int) -> None:
    """Simulate the balls from their start."""
    mujoco.mj_resetData(model, data)
    data.qvel.reshape(-1, 6)[:, :3] = velocities
    for _ in range(steps):
        mujoco.mj_step(model, data)
