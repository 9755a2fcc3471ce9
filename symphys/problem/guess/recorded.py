"""A recorded motion of the same or a like world as a guess: all of it that a guess may name."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from symphys.dynamics.observation import joint_turn
from symphys.model.joints import Joint
from symphys.model.world import World
from symphys.problem.guess.motion import GuessedMotion
from symphys.problem.guess.names import RATES, ball_joints, guessable
from symphys.types import Array

SPEEDS = {"velocity", "rate", *RATES.values()}
"""Fields of quantities that are rates."""


def recorded_guess(world: World, times: Array, recorded: Mapping[str, Array], pace: float = 1.0) -> GuessedMotion:
    """The motion through what was recorded; its columns are what the world and the recording both have.

    Args:
        world: of the problem that is guessed.
        times: (K,) [s] of the guess, ascending.
        recorded: quantities of bodies and joints at these times by their names, (K,) or (K, components).
        pace: rates are so many times what was recorded, as where the same way takes another time.
    """
    found = {**recorded}
    for joint in ball_joints(world):
        bodies = [world.bodies[i].name for i in joint.bodies]
        names = [f"{body}.{field}" for field in ("orientation", "angular_velocity") for body in bodies]
        if all(name in recorded for name in names):
            turn, spin = turns_of(joint)(*(np.asarray(recorded[name], float).T for name in names))
            found |= {f"{joint.name}.orientation": np.array(turn).T, f"{joint.name}.angular_velocity": np.array(spin).T}
    columns = {}
    for name, size in guessable(world).items():
        if name not in found:
            continue
        values, field = np.asarray(found[name], float).reshape(len(times), -1), name.rpartition(".")[2]
        if values.shape[1] != size or not np.isfinite(values).all():
            continue
        if field == "angle":
            values = np.unwrap(values, axis=0)
        columns[name] = times, values * pace if field in SPEEDS else values
    return GuessedMotion(columns)


def turns_of(joint: Joint) -> ca.Function:
    """(orientations of the bodies..., angular velocities...) -> ``joint_turn``, the numbers as columns of time."""
    count = len(joint.bodies)
    q, w = ([ca.SX.sym(f"{letter}{k}", size) for k in range(count)] for letter, size in (("q", 4), ("w", 3)))
    return ca.Function("turns", [*q, *w], list(joint_turn(joint, tuple(q), tuple(w))))
