"""What the bodies of a rollout weigh and how large they are, with the parameters that variables set."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.dynamics.motion import inertia_matrix
from symphys.transcription import Record, Rollout

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Bodies:
    """``mass`` (B,) [kg], ``size`` (B,) [m] radius of gyration, of a frame the largest, ``gravity`` (3,) [m/s^2]."""

    mass: Array
    size: Array
    gravity: Array


def bodies(rollout: Rollout, record: Record) -> Bodies:
    """Those of a rollout."""
    world = rollout.world
    mass = ca.vertcat(*(ca.SX(body.mass) for body in world.bodies))
    inertia = ca.vertcat(*(ca.trace(inertia_matrix(body.inertia)) / 3 for body in world.bodies))
    size = ca.vertcat(*(ca.SX(0) if b.massless else ca.sqrt(inertia[k] / mass[k]) for k, b in enumerate(world.bodies)))
    results = [mass, size, ca.vertcat(*(ca.SX(g) for g in world.gravity))]
    numbers = ca.Function("bodies", [parameters(rollout)], results)(record.arrays.p)
    found = Bodies(*(np.array(part).ravel() for part in numbers))
    frames = np.array([body.massless for body in world.bodies], bool)
    return replace(found, size=np.where(frames, found.size.max(), found.size))


def parameters(rollout: Rollout) -> Any:
    """(np,) the symbols that p stacks."""
    return ca.vertcat(ca.SX(0, 1), *rollout.parameters.symbols)
