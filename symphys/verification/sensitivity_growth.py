"""The sensitivity of the end of a motion to its state at every earlier instant: |dx_T/dx_t|.

A few random directions of the final state are swept backwards through the exact trajectory by the adjoint of the step.
The largest singular value of what they become estimates the norm from below: in a chain of collisions it grows
exponentially with the distance from the end, in free flight like T - t.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from symphys.model.state_layout import GIVEN, Layout
from symphys.transcription import Record, Rollout, Transcription
from symphys.types import Array
from symphys.verification.bodies import bodies

DIRECTIONS = 4
MAX_SAMPLES = 200


def sensitivity_growth(transcription: Transcription, record: Record) -> dict[str, list[float]]:
    """Estimate the sensitivity of the final state along the horizon.

    Returns:
        "time" [s], some 200 instants, and "factor", the estimate of |dx_T/dx_t| there, 1 at the end; NaN where the
        adjoint is not finite. Distances count in m, velocities in m/s; angles and angular velocities count as those of
        points at the body's radius of gyration. What a state remembers of forces is left out.
    """
    rollout = transcription.rollout
    count = len(state_columns(rollout))
    ends = np.linalg.qr(np.random.default_rng(2).standard_normal((count, min(DIRECTIONS, count))))[0]
    factors = np.full(rollout.steps + 1, np.nan)
    keep = samples(rollout.steps + 1, MAX_SAMPLES)
    kept = set(keep.tolist())
    for k, swept in backwards(transcription, record, ends):
        if not np.isfinite(swept).all():
            break
        if k in kept:
            factors[k] = np.linalg.norm(swept, 2)
    return {"time": (keep * rollout.dt).tolist(), "factor": factors[keep].tolist()}


def samples(count: int, most: int) -> NDArray[np.intp]:
    """Return at most ``most`` indices below ``count``, evenly spread, with the first and the last."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(np.intp))


def backwards(transcription: Transcription, record: Record, ends: Array) -> Iterator[tuple[int, Array]]:
    """Yield from the last state to the first its number k and d (ends . x_T) / dx_k (n, m).

    Args:
        transcription: of the problem.
        record: an exact rollout.
        ends: (n, m) directions of the final state, ordered like ``state_columns``, in its units.

    Yields:
        Derivatives in the same order and units; of an orientation only its rotation is changed, not its length.
    """
    rollout, x = transcription.rollout, record.arrays.x
    columns, units, layout = state_columns(rollout), state_units(rollout, record), Layout(rollout.world)
    quaternions = [layout[f"{body.name}.orientation"] for body in rollout.world.bodies]
    whole = np.zeros((x.shape[1], ends.shape[1]))
    whole[columns] = ends * units[:, None]
    yield rollout.steps, ends
    for k, adjoint in zip(reversed(range(rollout.steps)), transcription.back(record, whole), strict=True):
        yield k, _turned(quaternions, x[k], adjoint)[columns] / units[:, None]


def state_columns(rollout: Rollout) -> NDArray[np.intp]:
    """Return the columns (n,) of the state with poses and velocities of bodies, without the memory of forces."""
    layout = Layout(rollout.world)
    parts = [layout[f"{body.name}.{field}"] for body in rollout.world.bodies for field in GIVEN]
    return np.concatenate([np.arange(part.start, part.stop) for part in parts])


def state_units(rollout: Rollout, record: Record) -> Array:
    """Return the weight (n,) of a change by 1 of each of ``state_columns``, in m or m/s."""
    units = []
    for size in bodies(rollout, record).size:
        weights = {"position": 1.0, "orientation": 2 * size, "velocity": 1.0, "angular_velocity": size}
        units += [weights[field] for field in GIVEN for _ in range(4 if field == "orientation" else 3)]
    return np.array(units)


def _turned(quaternions: Sequence[slice], x: Array, adjoint: Array) -> Array:
    """Return the adjoint (nx, m) without the part that would change a quaternion's length."""
    result = adjoint.copy()
    for part in quaternions:
        q = x[part, None]
        result[part] -= q @ (q.T @ adjoint[part])
    return result
