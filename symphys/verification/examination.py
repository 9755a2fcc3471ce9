"""The examination: what is measured at one z."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from symphys.transcription import Record, Transcription, first_non_finite, first_non_finite_derivative
from symphys.types import Array
from symphys.verification import gradient, refinement
from symphys.verification.balance import balance, jumps
from symphys.verification.contacts import contacts, slides
from symphys.verification.near_misses import near_misses, tunnelling
from symphys.verification.sensitivity_growth import sensitivity_growth
from symphys.verification.target_conflicts import held_bounds, target_conflicts

Tell = Callable[[str], None]

SIMULATING = "simulating"
COMPARING = "comparing the gradient with differences"
SWEEPING = "sweeping the sensitivity back through time"
NEAR = "looking for near misses"
CONFLICTS = "looking for targets and bounds that stand in the way"
SMOOTHING = "smoothing, and adding up energy and momentum"
PARTS = {
    **{SIMULATING: 5.0, COMPARING: 20.0},
    **dict.fromkeys(refinement.TOLD.values(), 18.0),
    **{SWEEPING: 4.0, NEAR: 2.0, CONFLICTS: 3.0, SMOOTHING: 4.0},
}
"""The parts of an examination that take time, in their order, and about how much of it each takes; measured with the
shipped problems, beside some 8 for building the problem."""


@np.errstate(invalid="ignore", over="ignore")  # numbers that are not finite are reported as such
def examine(transcription: Transcription, z: Array, tell: Tell = lambda what: None) -> dict[str, Any]:
    """Return the "trust" object of a result, for the exact rollout of ``z`` (n,).

    Each module of this room says what its numbers are. "fault" is a clause on the first number or derivative that is
    not finite, empty if all are. ``tell`` is called with a few words before each part that takes time. Where contacts
    are not recorded there are "gradient", "refined", "order" and "bounds" alone.

    Raises:
        NotFinite: there is no such motion; says where it ends and why.
    """
    tell(SIMULATING)
    record = transcription.record(z)
    tell(COMPARING)
    compared = gradient.compare_gradient(transcription, z)
    finer = refinement.refine(transcription, z, tell)
    if not transcription.records_contacts:
        return {"gradient": compared, **finer, "bounds": held_bounds(transcription, z)}
    tell(SWEEPING)
    timed = transcription.timed(record)
    grown = sensitivity_growth(timed, record)
    tell(NEAR)
    near = near_misses(timed, record)
    tell(CONFLICTS)
    standing = {**target_conflicts(transcription, record), "bounds": held_bounds(transcription, z)}
    tell(SMOOTHING)
    motion = survey(transcription, record)
    return {
        "gradient": compared,
        **finer,
        "growth": grown,
        "smoothed": refinement.smoothed(transcription, record),
        **motion,
        **refinement.settling(transcription, z, motion["residual"], motion["impulse"]),
        "misses": near,
        **standing,
        "slides": slides(timed.rollout, record),
        "fault": _fault(transcription, record, compared),
    }


def _fault(transcription: Transcription, record: Record, compared: list[dict[str, Any]]) -> str:
    """Return a clause on the first number or derivative that is not finite; empty if all are."""
    verdict = transcription.judge(record.z)
    numbers = [verdict.objective, *verdict.costs.values(), *(check.error for check in verdict.checks)]
    if not np.isfinite([*numbers, *record.arrays.x.ravel()]).all():
        return first_non_finite(transcription.rollout, record.arrays)
    if not np.isfinite([row["scale"] for row in compared]).all():
        return first_non_finite_derivative(transcription.rollout, record.arrays)
    return ""


@np.errstate(invalid="ignore", over="ignore", divide="ignore")  # numbers that are not finite are reported as such
def survey(transcription: Transcription, record: Record) -> dict[str, Any]:
    """Measure energy, momentum, jumps, contacts and tunnelling, which takes little time beside a solve.

    Where impulses of contacts have not settled, steps or the motion are simulated again with other numbers of sweeps.

    Each module says what its numbers are.
    """
    if not transcription.records_contacts:
        return {}
    rollout = transcription.timed(record).rollout
    resolved = contacts(rollout, record)
    size = resolved["residual"], resolved["impulse"]
    again = {**refinement.left(transcription, record, *size), **refinement.resettled(transcription, record.z, *size)}
    return {**balance(rollout, record), **jumps(rollout, record), **resolved, **again, **tunnelling(rollout, record)}
