"""Compare the first second of a problem's motion with that of its model in MuJoCo, if that is installed."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from symphys.export.mjcf import MjcfModel, one_line, problem_model
from symphys.export.mjcf_departures import Departure
from symphys.export.mjcf_joints import names
from symphys.model.world import World, side_name
from symphys.problem import Problem
from symphys.trajectory import NotFinite, Trajectory
from symphys.transcription import transcribe

MAX_DURATION = 1.0
"""Largest duration of the comparison [s]."""
MAX_WORK = 20_000
"""Largest product of bodies and steps. Of larger models, which take minutes here, only MuJoCo's motion is checked."""


def tried_model(problem: Problem, approximate: bool) -> MjcfModel:
    """Write a problem's model with the result of the trial in its first lines; no trial without MuJoCo."""
    model = problem_model(problem, approximate)
    if importlib.util.find_spec("mujoco") is None:
        return model
    factors = stiffer(problem.world(), model.text)
    model = problem_model(problem, approximate, factors) if factors else model
    found = trial(problem, model.text)
    first, rest = model.text.split("\n", 1)
    return replace(
        model,
        text=f"{first}\n  <!-- {one_line(str(found))} -->\n{rest}",
        departures=(*model.departures, found),
    )


def stiffer(world: World, text: str) -> dict[tuple[str, str], float]:
    """Compute the factors on stiffness and damping of compliant contacts, by the names of their surfaces.

    The mass behind such a contact is that of its two bodies here. MuJoCo's compiler computes it from the whole tree at
    coordinates 0.
    """
    soft = {(pair.first, pair.second) for pair in world.pairs if pair.law.soft}
    if not soft:
        return {}
    import mujoco

    model, found = mujoco.MjModel.from_xml_string(text), {}
    for sides in soft:
        own = there = 0.0
        for side in sides:
            if side.body is not None and not world.bodies[side.body].massless:
                body = world.bodies[side.body]
                own += 1 / body.mass
                there += float(model.body(body.name).invweight0[0])
        names = tuple(side_name(world.bodies, world.statics, side) for side in sides)
        found[names[0], names[1]] = there / own if own else 1.0
    return found


def trial(problem: Problem, text: str) -> Departure:
    """Measure how far MuJoCo's motion is from the problem's, under the same commands and forces."""
    import mujoco

    work = len(problem.world().bodies) * problem.simulation.steps
    motion = own_motion(problem) if work <= MAX_WORK else None
    replayed = MujocoReplay(mujoco, problem.world(), text, motion)
    seconds, dt = min(MAX_DURATION, problem.simulation.duration), problem.simulation.dt
    place, turn = (0.0, ""), (0.0, "")
    for k in range(round(seconds / dt)):
        replayed.advance(k, dt)
        if not replayed.sound:
            after = f"after {(k + 1) * dt:.3g} s"
            return Departure("measured", ("motion",), f"MuJoCo {mujoco.__version__} does not hold this model {after}")
        for name, far, turned in replayed.gaps(k + 1):
            place, turn = max(place, (far, name)), max(turn, (turned, name))
    over = f"over the first {seconds:g} s MuJoCo {mujoco.__version__}"
    if motion is None:
        return Departure("measured", ("motion",), f"{over} holds this model; the motions were not compared")
    most = f"{1000 * place[0]:.3g} mm ({place[1]}) and {np.degrees(turn[0]):.3g} degrees ({turn[1]})"
    return Departure("measured", ("motion",), f"{over} is off by at most {most}, under the same commands")


def own_motion(problem: Problem) -> Trajectory | None:
    """Simulate the problem from the start of the model with the guess of its controls; None if not finite."""
    made = transcribe(problem, backend="casadi")
    known = {**problem.initial, **problem.parametric.starts(), **problem.parameters, **problem.weights}
    z = made.shooting.start(0)
    for block, variable in zip(made.shooting.blocks, problem.variables, strict=True):
        slot = variable.slots[0]
        if variable.kind != "control" and slot.name in known:
            z[block.start : block.stop] = np.asarray(known[slot.name], float)[list(slot.components)]
    try:
        return made.simulate(z)
    except NotFinite:
        return None


class MujocoReplay:
    """A simulation in MuJoCo under the forces and commands of a motion, or without any."""

    def __init__(self, mujoco: Any, world: World, text: str, motion: Trajectory | None) -> None:
        """Reset MuJoCo to the keyframe of the start."""
        self._step, self._motion = mujoco.mj_step, motion
        self._model = mujoco.MjModel.from_xml_string(text)
        self._data = mujoco.MjData(self._model)
        mujoco.mj_resetDataKeyframe(self._model, self._data, 0)
        self._bodies = [(k, body.name) for k, body in enumerate(world.bodies) if not body.massless]
        self._motors = [
            (j, i, name)
            for j, joint in enumerate(world.joints)
            if joint.motor is not None
            for i, name in enumerate(names(joint))
        ]

    def advance(self, k: int, dt: float) -> None:
        """Simulate step ``k`` of the motion, of length ``dt`` [s]."""
        if self._motion is not None:
            for body, name in self._bodies:
                self._data.body(name).xfrc_applied[:3] = self._motion.force[k, body]
                self._data.body(name).xfrc_applied[3:] = self._motion.torque[k, body]
            for joint, coordinate, name in self._motors:
                self._data.actuator(name).ctrl = self._motion.joint_command[k, joint, coordinate]
        for _ in range(max(1, round(dt / self._model.opt.timestep))):
            self._step(self._model, self._data)

    @property
    def sound(self) -> bool:
        """Whether all numbers are finite, and MuJoCo has not reset itself because they were not."""
        restarts = sum(each.number for each in self._data.warning)
        return not restarts and bool(np.isfinite(self._data.qpos).all())

    def gaps(self, k: int) -> Iterator[tuple[str, float, float]]:
        """Yield the name of each body, and its distance [m] and angle [rad] from the motion at instant ``k``."""
        for body, name in self._bodies if self._motion is not None else ():
            here = self._data.body(name)
            far = float(np.linalg.norm(here.xipos - self._motion.position[k, body]))  # type: ignore[union-attr]
            same = abs(float(here.xquat @ self._motion.orientation[k, body]))  # type: ignore[union-attr]
            yield name, far, 2 * math.acos(min(1.0, same))
