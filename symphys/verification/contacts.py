"""The accuracy with which contacts were resolved, and the sliding of surfaces."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.codegen.backends.calls import row_by_row
from symphys.dynamics.observation import slip_function
from symphys.trajectory import Trajectory
from symphys.transcription import Record, Rollout, plain
from symphys.types import Array
from symphys.verification.bodies import bodies
from symphys.verification.refinement import UNSETTLED

MAX_SLIDES = 5


def contacts(rollout: Rollout, record: Record) -> dict[str, Any]:
    """Return how cleanly the contacts were resolved.

    Returns:
        "residual" [N s]: the largest change of an impulse in a last sweep, at "residual_at" [s]; "impulse" [N s]: the
        largest impulse of a contact in a step; "unsettled", in how many steps that change is large beside it.
        "deepest" [m]: how far rigid surfaces overlapped, with the "contact" and "time" [s] in "deepest_at" (None where
        they did not); "size" [m]: the smallest radius of gyration of a body. "steps", and in how many of them
        "multiple_impacts" of a body, "ambiguous_impacts" of several bodies at one instant, and "paradoxes" of friction.
    """
    motion = record.motion
    impulse = float(np.linalg.norm(motion.contact_force, axis=2).max(initial=0.0) * rollout.dt)
    return {
        "residual": float(motion.residual.max(initial=0.0)),
        "residual_at": float(motion.time[int(motion.residual.argmax())]),
        "impulse": impulse,
        "unsettled": int((motion.residual > UNSETTLED * impulse).sum()) if impulse > 0 else 0,
        "steps": rollout.steps,
        "multiple_impacts": int(motion.crowded.sum()),
        "ambiguous_impacts": int(motion.ambiguous.sum()),
        "paradoxes": int(motion.paradox.sum()),
        "size": float(bodies(rollout, record).size.min()),
        **_deepest(rollout, motion),
    }


def surface(contact: str) -> str:
    """Return the name of the two surfaces of a contact, without the number of the point."""
    return contact.partition(":")[0]


def acting(motion: Trajectory) -> NDArray[np.bool_]:
    """Return whether a contact gives an impulse in a step (N, C)."""
    return np.asarray(np.abs(motion.contact_force).sum(axis=2) > 0)


def touching(motion: Trajectory, k: int) -> list[str]:
    """Return the surfaces that act on each other in step k."""
    return list(dict.fromkeys(surface(motion.contact_names[c]) for c in np.flatnonzero(acting(motion)[k])))


def slides(rollout: Rollout, record: Record) -> list[dict[str, Any]]:
    """Return the contacts that slid furthest; of surfaces with several points, the point that slid furthest.

    Returns:
        Each with its "contact", "distance" [m], largest "speed" [m/s] and when, "time" [s]. Sliding is measured at the
        start of each step, where a contact bears a load in it and bore one in the step before: the slip of an impact is
        none.
    """
    motion = record.motion
    if not motion.contact_names:
        return []
    loaded = acting(motion)
    loaded[1:] &= loaded[:-1].copy()
    loaded[0] = False
    speeds = np.where(loaded, slip_speeds(rollout, record), 0.0)
    furthest: dict[str, dict[str, Any]] = {}
    for c in np.argsort(-speeds.sum(axis=0), kind="stable"):
        k, name = int(speeds[:, c].argmax()), surface(motion.contact_names[c])
        distance, speed = float(speeds[:, c].sum() * rollout.dt), float(speeds[k, c])
        if distance > 0:
            slide = {"contact": name, "distance": distance, "speed": speed, "time": float(motion.time[k])}
            furthest.setdefault(name, slide)
    return list(furthest.values())[:MAX_SLIDES]


def slip_speeds(rollout: Rollout, record: Record) -> Array:
    """Return the tangential speed at each contact at the start of each step (N, C) [m/s]."""
    arrays = record.arrays
    return row_by_row(rollout.built(slip_function), plain(rollout, arrays.x)[:-1], arrays.u, arrays.p)[0]


def _deepest(rollout: Rollout, motion: Trajectory) -> dict[str, Any]:
    rigid = np.flatnonzero([not pair.law.soft for pair in rollout.world.pairs])
    gaps = motion.contact_gap[:, rigid]
    if np.isnan(gaps).any():
        return {"deepest": float("nan"), "deepest_at": None}
    if not gaps.size or gaps.min() >= 0:
        return {"deepest": 0.0, "deepest_at": None}
    k, c = np.unravel_index(int(gaps.argmin()), gaps.shape)
    name = surface(motion.contact_names[int(rigid[c])])
    return {"deepest": float(-gaps[k, c]), "deepest_at": {"contact": name, "time": float(motion.time[k])}}
