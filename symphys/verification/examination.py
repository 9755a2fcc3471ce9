"""The examination of a gradient and a motion at one z; the gradient is compared with central differences."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from symphys.shooting import VariableBlock
from symphys.transcription import Record, Transcription, first_non_finite, first_non_finite_derivative
from symphys.types import Array
from symphys.verification import refinement
from symphys.verification.balance import balance, jumps
from symphys.verification.contacts import contacts, slides
from symphys.verification.near_misses import near_misses, tunnelling, untouched
from symphys.verification.sensitivity_growth import sensitivity_growth
from symphys.verification.target_conflicts import held_bounds, target_conflicts

Values = Callable[[Array], Array]

DIFFERENCE_STEPS = (1e-4, 1e-5, 1e-6)
"""Steps of the central differences, as shares of the scale; the best counts, and a wrong slope passes none."""
EVERY_COMPONENT, RANDOM_DIRECTIONS = 12, 4
"""Variables up to this size are differenced component by component, larger ones along so many random directions."""
SIDE_CHECK_ERROR = 1e-4
"""Relative error of central differences from which each side is examined by itself."""
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
    **{SWEEPING: 4.0, CONFLICTS: 3.0, NEAR: 2.0, SMOOTHING: 4.0},
}
"""The parts of an examination that take time, in their order, and about how much of it each takes; measured with the
shipped problems, beside some 8 for building the problem."""
OF_CONTACTS = ("residual", "deepest", "passed", "gained", "multiple_impacts", "ambiguous_impacts", "paradoxes")
"""Numbers of ``survey`` that mean nothing where nothing can touch."""


def finer_values(transcription: Transcription, z: Array) -> Iterator[dict[str, Any]]:
    """Yield the rows "refined" on which a verdict rests, without gradients, those that take longest last.

    Args:
        transcription: of a problem.
        z: (n,) whose motion is finite.
    """
    for what in (refinement.FINER_DT, refinement.FINEST_DT):
        yield refinement.finer_value(transcription, z, what)
    if transcription.records_contacts and not _settled(transcription, transcription.record(z)):
        yield refinement.finer_value(transcription, z, refinement.MORE_SWEEPS)


def _settled(transcription: Transcription, record: Record) -> bool:
    """Whether the impulses of contacts have settled, so that more sweeps change nothing."""
    resolved = contacts(transcription.timed(record).rollout, record)
    return not resolved["residual"] > refinement.SETTLED * resolved["impulse"]


def compare_gradient(transcription: Transcription, z: Array) -> list[dict[str, Any]]:
    """Compare the adjoint with central differences, per variable.

    What is differentiated is the transcription's ``Probe``, whose gradient does not vanish at a solution.

    Returns:
        For each variable "error", |adjoint - difference| / scale; "scale", the norm of its slope; "step", the step of
        the best difference as a share of the variable's scale; NaN where one is not finite. "felt": what a change by
        the variable's scale changes, as a share of the value, of what the variable that is felt most changes, or of 1,
        whichever is largest; 0 where nothing depends on it. "jump" is 0 where central differences agree best. Where
        those of either side, without z itself, agree better, the value jumps at z, by as much as a change of the
        variable by "jump" of its scale brings about. An impact at the very end of a step does that: the time grid
        changes sides.
    """
    probe, blocks = transcription.probe, transcription.shooting.blocks
    slope = probe.gradient(z)
    rows = [_compare_block(probe.values, block, z, slope) for block in blocks]
    effects = [float(np.linalg.norm(slope[block.start : block.stop] * block.scale)) for block in blocks]
    size = max(abs(float(probe.values(z[None])[0])), *effects, 1.0)
    return [row | {"felt": effect / size} for row, effect in zip(rows, effects, strict=True)]


def _compare_block(value: Values, block: VariableBlock, z: Array, slope: Array) -> dict[str, Any]:
    norm = float(np.linalg.norm(slope[block.start : block.stop])) or 1.0
    directions = _directions(block, block.stop - block.start, z.size)
    middle, at = _best(lambda steps: _mismatches(value, z, slope, directions, steps))
    found = {"variable": block.name, "scale": float(np.linalg.norm(slope[block.start : block.stop]))}
    found |= {"error": middle / norm, "step": at, "jump": 0.0}
    if middle > SIDE_CHECK_ERROR * norm:
        sides, near = _best(lambda steps: _mismatches_beside(value, z, slope, directions, steps))
        if sides < middle:
            jumps = 2 * near * _mismatches(value, z, slope, directions, (near,))
            found |= {"error": sides / norm, "step": near, "jump": max_or_nan(jumps) / norm}
    return found


def _best(mismatches: Callable[[Sequence[float]], Array]) -> tuple[float, float]:
    """Return (error, step): the least error over the steps, the worst over the directions; NaN if there is none."""
    errors = [max_or_nan(row) for row in mismatches(DIFFERENCE_STEPS)]
    known = [pair for pair in zip(errors, DIFFERENCE_STEPS, strict=True) if not np.isnan(pair[0])]
    return min(known, default=(np.nan, np.nan))


def max_or_nan(numbers: Array) -> float:
    """Return the largest number; NaN if one is NaN."""
    return float(np.max(numbers, initial=0.0))


def _directions(block: VariableBlock, size: int, n: int) -> Array:
    """Return unit steps (k, n) in the scale of each component, or random combinations of many."""
    inside = np.eye(size)
    if size > EVERY_COMPONENT:
        inside = np.random.default_rng(1).standard_normal((RANDOM_DIRECTIONS, size))
        inside /= np.linalg.norm(inside, axis=1, keepdims=True)
    whole = np.zeros((len(inside), n))
    whole[:, block.start : block.stop] = inside * block.scale
    return whole


def _mismatches(value: Values, z: Array, slope: Array, directions: Array, steps: Sequence[float]) -> Array:
    """Return the error of central differences for each step and direction (steps, k)."""
    high, low = np.moveaxis(_beside(value, z, directions, steps, (1, -1)), -1, 0)
    sizes, known = np.array(steps)[:, None], directions @ slope
    found: Array = abs((high - low) / (2 * sizes) - known) / np.linalg.norm(directions, axis=1)
    return found


def _mismatches_beside(value: Values, z: Array, slope: Array, directions: Array, steps: Sequence[float]) -> Array:
    """Return the larger error of both one-sided second-order derivatives, without z itself (steps, k)."""
    points = _beside(value, z, directions, steps, (1, 2, 3, -1, -2, -3))
    sizes, known, errors = np.array(steps)[:, None], directions @ slope, list[Array]()
    for side, (one, two, three) in (
        (1, np.moveaxis(points[..., :3], -1, 0)),
        (-1, np.moveaxis(points[..., 3:], -1, 0)),
    ):
        errors.append(abs((8 * two - 5 * one - 3 * three) / (2 * side * sizes) - known))
    larger: Array = np.maximum(*errors) / np.linalg.norm(directions, axis=1)
    return larger


def _beside(value: Values, z: Array, directions: Array, steps: Sequence[float], places: Sequence[int]) -> Array:
    """Return values (steps, k, places) at multiples of each step from z along each direction, in one batch."""
    offsets = np.multiply.outer(np.multiply.outer(np.array(steps), places), directions)
    points = z + np.moveaxis(offsets, 2, 1)
    return value(points.reshape(-1, z.size)).reshape(points.shape[:-1])


@np.errstate(invalid="ignore", over="ignore")  # numbers that are not finite are reported as such
def examine(
    transcription: Transcription,
    z: Array,
    tell: Tell = lambda what: None,
    whole: bool = True,
    slopes: bool = True,
    refuted: float = 1.0,
) -> dict[str, Any]:
    """Return the "trust" object of a result, for the exact rollout of ``z`` (n,).

    Each module of this room says what its numbers are. "fault" is a clause on the first number or derivative that is
    not finite, empty if all are. Where contacts are not recorded there are "gradient", "refined", "order" and "bounds"
    alone.

    Args:
        transcription: of a problem.
        z: (n,).
        tell: called with a few words before each part that takes time.
        whole: whether refinements are simulated that hardly say more; see ``refinement.refine``.
        slopes: whether derivatives are examined in any case. Else they are where finer simulations refute what z
            meets: a search that took none need not wait until they are compiled.
        refuted: error / tolerance of a finer simulation above which it refutes a result.

    Raises:
        NotFinite: there is no such motion; says where it ends and why.
    """
    tell(SIMULATING)
    record = transcription.record(z)
    timed = transcription.timed(record)
    settled = transcription.records_contacts and _settled(transcription, record)
    compared, finer = list[dict[str, Any]](), dict[str, Any]()
    if not slopes:
        finer = refinement.refine(transcription, z, tell, whole, settled, slopes=False)
        slopes = not (transcription.judge(z).solved and all(row["worst"] <= refuted for row in finer["refined"]))
    if slopes:
        tell(COMPARING)
        compared = compare_gradient(transcription, z)
        finer = refinement.refine(transcription, z, tell, whole, settled)
    if not transcription.records_contacts:
        return {"gradient": compared, **finer, "bounds": held_bounds(transcription, z)}
    standing: dict[str, Any] = {}
    if slopes:
        tell(SWEEPING)
        standing["growth"] = sensitivity_growth(timed, record)
        tell(CONFLICTS)
        standing |= target_conflicts(transcription, record)
    tell(NEAR)
    near = near_misses(timed, record)
    missed = [check.name for check in transcription.judge(z).checks if not check.met]
    tell(SMOOTHING)
    motion = survey(transcription, record)
    return {
        "gradient": compared,
        **finer,
        "smoothed": refinement.smoothed(transcription, record, whole),
        **motion,
        **refinement.settling(transcription, z, motion["residual"], motion["impulse"]),
        "misses": near,
        "untouched": untouched(timed.rollout, record, missed),
        **standing,
        "bounds": held_bounds(transcription, z),
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
    What is of contacts is nan in a world in which nothing can touch.

    Each module says what its numbers are.
    """
    if not transcription.records_contacts:
        return {}
    rollout = transcription.timed(record).rollout
    resolved = contacts(rollout, record)
    size = resolved["residual"], resolved["impulse"]
    again = {**refinement.left(transcription, record, *size), **refinement.resettled(transcription, record.z, *size)}
    found = {**balance(rollout, record), **jumps(rollout, record), **resolved, **again, **tunnelling(rollout, record)}
    return found if rollout.world.pairs else found | dict.fromkeys(OF_CONTACTS, np.nan)
