"""What the bodies of a rollout weigh and how large they are, with the parameters that variables set."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from symphys.dynamics.motion import inertia_matrix
from symphys.model.state_layout import input_symbols
from symphys.transcription import Record, Rollout
from symphys.types import Array


@dataclass(frozen=True)
class Bodies:
    """``mass`` (B,) [kg], ``size`` (B,) [m] radius of gyration, of a frame the largest, ``gravity`` (N, 3) [m/s^2]."""

    mass: Array
    size: Array
    gravity: Array


def bodies(rollout: Rollout, record: Record) -> Bodies:
    """Those of a rollout."""
    world = rollout.world
    mass = ca.vertcat(*(ca.SX(body.mass) for body in world.bodies))
    inertia = ca.vertcat(*(ca.trace(inertia_matrix(body.inertia)) / 3 for body in world.bodies))
    size = ca.vertcat(*(ca.SX(0) if b.massless else ca.sqrt(inertia[k] / mass[k]) for k, b in enumerate(world.bodies)))
    numbers = ca.Function("bodies", [parameters(rollout)], [mass, size])(record.arrays.p)
    found = Bodies(np.array(numbers[0]).ravel(), np.array(numbers[1]).ravel(), gravity(rollout, record))
    frames = np.array([body.massless for body in world.bodies], bool)
    return replace(found, size=np.where(frames, found.size.max(), found.size))


def gravity(rollout: Rollout, record: Record) -> Array:
    """(N, 3) [m/s^2] in each step, as phases may set it."""
    u = input_symbols(rollout.world, rollout.inputs)
    vector = ca.vertcat(*(ca.SX(g) for g in rollout.world.gravity))
    of_step, arrays = ca.Function("gravity", [u, parameters(rollout)], [ca.densify(vector)]), record.arrays
    return np.array(of_step.map(rollout.steps)(arrays.u.T, np.tile(arrays.p[:, None], rollout.steps))).T


def parameters(rollout: Rollout) -> Any:
    """(np,) the symbols that p stacks."""
    return ca.vertcat(ca.SX(0, 1), *rollout.parameters.symbols)
