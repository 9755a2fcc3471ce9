"""States of a guessed motion: those of the guess's rollout, moved to the named quantities."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np

from symphys.dynamics.observation import SensedState, joint_turn, named_sensors, sensor_readings
from symphys.model.state_layout import Layout
from symphys.problem import DURATION, GuessedMotion
from symphys.problem.guess.motion import is_orientation, turn_between
from symphys.problem.guess.names import ball_joints, guessable, rate_of
from symphys.transcription.staged.stage_functions import ByColumns
from symphys.transcription.staged.staged_problem import RolloutStages
from symphys.types import Array, Ints


def guessed_states(stages: RolloutStages, guess: GuessedMotion, z: Array, ticks: Ints, smoothing: float) -> Array:
    """Return states (M, nx) at the ticks (M,), each at least 1.

    What is named, and its rate, is moved along the tangent, so that joints stay closed; all else is that of the rollout
    of z (n,), of its first step from where on it is not finite.
    """
    moved, dt = stages.roll_out(z, smoothing).x, stages.rollout.dt
    states, times = moved[ticks], np.asarray(ticks * dt, float)
    states[~np.isfinite(states).all(axis=1)] = moved[1]
    off, names = np.zeros((len(ticks), stages.tangent_size)), list(stages.tangent.names)
    now, stretch = _quantities(stages, guess, states, z), _stretch(stages, z)

    def move(name: str, ahead: Array) -> None:
        for entry, column in zip(_entries(name, names), ahead.T, strict=True):
            off[:, entry] = column

    sizes = guessable(stages.rollout.world)
    for name in guess.columns:
        there = guess.at(name, times)
        move(name, turn_between(now[name], there) if is_orientation(name) else there - now[name])
        rate = rate_of(name, sizes)
        if rate and rate not in guess.columns:
            move(rate, guess.rate(name, times, dt) / stretch - now[rate])
    return stages.retract(states, off)


def _entries(name: str, names: list[str]) -> Iterator[int]:
    """Return the columns of a quantity in the tangent, where all joints have coordinates and rates."""
    owner, _, field = name.rpartition(".")
    jointed = f"{owner}.coordinate[0]" in names
    words = {"angle": "coordinate", "position": "coordinate", "orientation": "coordinate", "angular_velocity": "rate"}
    field = words.get(field, field) if jointed else "turn" if field == "orientation" else field
    count = sum(each.startswith(f"{owner}.{field}[") for each in names)
    return (names.index(f"{owner}.{field}[{k}]") for k in range(count))


def _stretch(stages: RolloutStages, z: Array) -> float:
    """Return the duration of the motion of z divided by that in the file."""
    problem, columns = stages.rollout.problem, stages.rollout.parameters.columns
    if not problem.free_duration:
        return 1.0
    return float(stages.parameters(z[None])[0][columns[DURATION]][0]) / problem.simulation.duration


def _quantities(stages: RolloutStages, guess: GuessedMotion, states: Array, z: Array) -> dict[str, Array]:
    """Return (M, components) of all quantities of the owners of the guessed ones."""
    rollout = stages.rollout
    world, layout = rollout.world, Layout(rollout.world)
    x, p = ca.SX.sym("x", layout.size), ca.SX.sym("p", int(rollout.p.shape[0]))
    owners = {name.rpartition(".")[0] for name in guess.columns}
    found = {name: x[layout[name]] for name in layout.names() if name.rpartition(".")[0] in owners}
    of_joints = (n for n, s in named_sensors(world).items() if s.kind.owner == "joint" and s.owner.name in owners)
    found |= sensor_readings(SensedState(world, x), frozenset(of_joints))
    for joint in ball_joints(world):
        if joint.name in owners:
            bodies = [world.bodies[i].name for i in joint.bodies]
            fields = ("orientation", "angular_velocity")
            parts = (tuple(x[layout[f"{body}.{field}"]] for body in bodies) for field in fields)
            found |= dict(zip((f"{joint.name}.{field}" for field in fields), joint_turn(joint, *parts), strict=True))
    symbols = ca.vertcat(ca.SX(0, 1), *rollout.parameters.symbols)
    values = [ca.densify(ca.substitute(ca.SX(value), symbols, p)) for value in found.values()]
    function = ByColumns(ca.Function("named", [x, p], values))
    parameters = np.tile(stages.parameters(z[None]), (len(states), 1))
    rows = function(states[:, : layout.size].T, parameters.T)
    return {name: row.T for name, row in zip(found, rows, strict=True)}
