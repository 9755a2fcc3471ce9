"""Targets that cannot be met together, and bounds that hold an answer back.

Targets are counted against the unknowns, contradict each other near z, or are opposed at z. A target is a penalty
beside the costs: those that the costs hold back are found too. A bound holds z back where z lies at it and the merit
falls beyond it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.problem import Target
from symphys.records import dataclass
from symphys.shooting import ShootingProblem, VariableBlock
from symphys.transcription import Record, Rollout, Transcription
from symphys.transcription.recorded_parts import RolloutArrays, formula_arguments, part_numbers
from symphys.transcription.terms import instant
from symphys.types import Array
from symphys.verification.sensitivity_growth import DIRECTIONS

BOUND_TOLERANCE = 1e-9
"""A component lies at a bound within this share of 1 + the bound."""
MIN_GAIN_SHARE = 1e-6
"""Gain of a change by the scale, as a share of 1 + |merit|, below which a bound does not count as active."""
MAX_COMPONENTS = 16
"""Components of targets up to which contradictions are searched."""
MORE_SAMPLES = 2
"""Points beside z in addition to one for each component."""
NEAREST, FURTHEST = 1e-2, 0.5
"""Range of distances of the points from z, in units of the variables' scales."""
DEPENDENT = 1e-6
"""Changes with a combination below this share of their size are linearly dependent."""
NO_CHANGE = 1e-9
"""A component that changes by less, relative to 1 + its size, does not change."""
OPPOSED = 1e-2
"""Gradients cancel where their sum is below this share of the sum of their lengths."""
BALANCED = 0.05
"""The gradients of targets and of all else cancel where their sum is below this share of the sum of their lengths."""
NEARER = 0.5
"""A step towards targets that can be met leaves less than this share of what is missed; a linear one leaves 0.25."""
MIN_SHARE = 0.05
"""Targets with less than this share of the largest part are not named."""


def held_bounds(transcription: Transcription, z: Array) -> list[dict[str, Any]]:
    """Return the bounds at ``z`` (n,) beyond which the merit would fall, the largest gain first.

    Returns:
        Each with its "variable", "component" of "components", "side" ("lower" or "upper"), and "bound", NaN where it is
        not the same at all of these knots; "knots" that lie there, "of" all; "gain", what the change of the component
        by its scale at all of these knots would gain, to first order.
    """
    shooting = transcription.shooting
    lower, upper = shooting.stacked("lower"), shooting.stacked("upper")
    free = lower < upper
    sides = {side: free & lies_at(z, bound) for side, bound in (("lower", lower), ("upper", upper))}
    if not any(at.any() for at in sides.values()):
        return []
    values = shooting.evaluator.gradient(z[None], 0.0)
    if values.gradient is None or not np.isfinite(values.gradient).all():
        return []
    slope = values.gradient[0] * shooting.stacked("scale")
    least = MIN_GAIN_SHARE * (1 + abs(float(values.merit[0])))
    gains = {"lower": np.where(sides["lower"], slope, 0.0), "upper": np.where(sides["upper"], -slope, 0.0)}
    rows = [row for block in shooting.blocks for side in gains for row in _rows(block, side, gains[side], least)]
    return sorted(rows, key=lambda row: -float(row["gain"]))


def lies_at(z: Array, bound: Array) -> NDArray[np.bool_]:
    """Return whether z lies at a bound (n,), which may be infinite."""
    finite = np.where(np.isfinite(bound), bound, 0.0)
    return np.asarray(np.isfinite(bound) & (np.abs(z - finite) <= BOUND_TOLERANCE * (1 + np.abs(finite))))


def _rows(block: VariableBlock, side: str, gains: Array, least: float) -> list[dict[str, Any]]:
    """Return the rows of one variable; ``gains`` (n,): of each component of z."""
    components, knots = block.shape
    gain = gains[block.start : block.stop].reshape(knots, components)
    bounds = getattr(block, side).reshape(knots, components)
    rows = []
    for i in range(components):
        held = gain[:, i] > least
        if held.any():
            same = bounds[held, i]
            bound = float(same[0]) if np.ptp(same) == 0 else float("nan")
            found = {"variable": block.name, "component": i, "components": components, "side": side, "bound": bound}
            rows.append(found | {"knots": int(held.sum()), "of": knots, "gain": float(gain[held, i].sum())})
    return rows


@dataclass(frozen=True)
class TargetSample:
    """A target at its own instant of a rollout: its value (m,), tolerance, and where its formula is evaluated."""

    target: Target
    function: ca.Function
    k: int
    arguments: tuple[Array, ...]
    value: Array

    @property
    def missed(self) -> bool:
        """Whether it is not within its tolerance."""
        return not float(np.linalg.norm(self.value)) <= self.target.tolerance


def target_conflicts(transcription: Transcription, record: Record) -> dict[str, Any]:
    """Find targets that conflict with each other at the z of ``record``.

    Returns:
        "equations", the number of components of all targets, and "unknowns", that of the components of z that may vary;
        0 equations where everything is met. "contradicting": names of targets that cannot all be met as long as the
        motion changes with z as it does nearby, since some combination of their values stays the same, and too large.
        "opposed": names of targets whose gradients cancel at z: what brings one nearer takes another away.
        "outweighed": names of missed targets whose gradients the costs' gradient cancels, though a step would bring
        them nearer. All are empty where none was found, or for problems with large nets.
    """
    shooting = transcription.shooting
    nothing: dict[str, Any] = {"contradicting": [], "opposed": [], "outweighed": []}
    functions = [transcription.rollout.compiled(target.formula) for target in transcription.problem.targets]
    samples = target_samples(transcription.rollout, record.arrays, functions)
    if not any(sample.missed for sample in samples):
        return {"equations": 0, "unknowns": 0, **nothing}
    free = shooting.stacked("lower") < shooting.stacked("upper")
    found = {"equations": sum(sample.value.size for sample in samples), "unknowns": int(free.sum())}
    rivals = len(samples) > 1 or bool(transcription.problem.costs)
    slopes = target_slopes(transcription, record, samples) if rivals else None
    if slopes is None or not np.isfinite(slopes).all():
        return found | nothing
    names = [sample.target.name for sample in samples]
    held = opposed(slopes * shooting.stacked("scale"), pushed(shooting, record.z, slopes.sum(axis=0)) | ~free)
    missed = any(samples[i].missed for i in held)
    return found | {
        "contradicting": [names[i] for i in contradicting(transcription, samples, record.z, free)],
        "opposed": [names[i] for i in held if missed],
        "outweighed": [names[i] for i in outweighed(transcription, record, samples, slopes)],
    }


def target_samples(rollout: Rollout, arrays: RolloutArrays, functions: Sequence[ca.Function]) -> list[TargetSample]:
    """Evaluate every target of a rollout, whose formulas are compiled to ``functions``."""
    found = []
    for target, function in zip(rollout.problem.targets, functions, strict=True):
        ((k, row),) = instant(rollout, target.at).pairs
        arguments = (*formula_arguments(arrays, k, row), *part_numbers(rollout, arrays, target.formula))
        found.append(TargetSample(target, function, k, arguments, np.array(function(*arguments)).ravel()))
    return found


def target_slopes(transcription: Transcription, record: Record, samples: list[TargetSample]) -> Array | None:
    """Return the derivatives of weight * |value|^2 by z (T, n).

    None where a formula depends on inputs, on a whole motion or on the time of a free duration, or for problems with
    large nets.
    """
    if transcription.problem.free_duration and any("time" in each.target.formula.names for each in samples):
        return None
    rows: list[Array] = []
    for first in range(0, len(samples), DIRECTIONS):
        some, states = samples[first : first + DIRECTIONS], dict[int, Array]()
        by_p = np.zeros((record.arrays.p.size, DIRECTIONS))
        direct = np.zeros((record.arrays.z.size, DIRECTIONS))
        for column, sample in enumerate(some):
            parts = _by_arguments(sample)
            if parts is None:
                return None
            by_x, by_p[:, column], direct[:, column] = parts
            states.setdefault(sample.k, np.zeros((by_x.size, DIRECTIONS)))[:, column] = by_x
        pulled = transcription.pull(record, states, by_p)
        if pulled is None:
            return None
        rows += list((pulled + direct).T[: len(some)])
    return np.array(rows)


def _by_arguments(sample: TargetSample) -> tuple[Array, Array, Array] | None:
    """Return derivatives of weight * |value|^2 by x, p and z; None if it depends on inputs or whole motions."""
    if sample.target.formula.parts:
        return None
    inputs = sample.function.sx_in()
    (value,) = sample.function.call(inputs)
    if inputs[1].shape[0] and ca.depends_on(value, inputs[1]):
        return None
    number = sample.target.weight * ca.sumsqr(value)
    slopes = [ca.densify(ca.gradient(number, inputs[i])) for i in (0, 2, 4)]
    x, p, z = ca.Function("slopes", inputs, slopes)(*sample.arguments)
    return np.array(x).ravel(), np.array(p).ravel(), np.array(z).ravel()


def pushed(shooting: ShootingProblem, z: Array, slope: Array) -> NDArray[np.bool_]:
    """Return which components lie at a bound that a step down the slope would leave (n,)."""
    lower, upper = (lies_at(z, shooting.stacked(side)) for side in ("lower", "upper"))
    return np.asarray((lower & (slope > 0)) | (upper & (slope < 0)))


def opposed(slopes: Array, fixed: NDArray[np.bool_]) -> list[int]:
    """Return which of the gradients (T, n) cancel, without ``fixed`` (n,) components; none or at least two."""
    slopes = np.where(fixed, 0.0, slopes)
    lengths = np.linalg.norm(slopes, axis=1)
    if float(np.linalg.norm(slopes.sum(axis=0))) > OPPOSED * float(lengths.sum()):
        return []
    parts = np.flatnonzero(lengths > max(MIN_SHARE * float(lengths.max(initial=0.0)), NO_CHANGE))
    return parts.tolist() if parts.size > 1 else []


def outweighed(
    transcription: Transcription, record: Record, samples: Sequence[TargetSample], slopes: Array
) -> list[int]:
    """Return which missed targets the costs hold back at z: their gradients (T, n) cancel that of everything else.

    Where no point nearby meets the targets better, the costs are not to blame: this is tried with one step down the
    targets' gradient, to where it would be halfway to 0 if it were linear.
    """
    shooting, missed = transcription.shooting, [i for i, sample in enumerate(samples) if sample.missed]
    values = shooting.evaluator.gradient(record.z[None], 0.0) if transcription.problem.costs else None
    if values is None or values.gradient is None or shooting.violation(values.errors[0]) > 0:
        return []
    scale, whole = shooting.stacked("scale"), values.gradient[0]
    fixed = pushed(shooting, record.z, whole) | (shooting.stacked("lower") == shooting.stacked("upper"))
    own, total = (np.where(fixed, 0.0, slope * scale) for slope in (slopes[missed].sum(axis=0), whole))
    sizes = float(np.linalg.norm(own)) + float(np.linalg.norm(total - own))
    if not (own.any() and float(np.linalg.norm(total)) <= BALANCED * sizes):
        return []
    height = penalty([samples[i] for i in missed])
    step = height / float(own @ own) * own * scale
    z = np.clip(record.z - step, shooting.stacked("lower"), shooting.stacked("upper"))
    beside = transcription.arrays(z)
    if not beside.finite:
        return []
    nearer = target_samples(transcription.rollout, beside, [sample.function for sample in samples])
    return missed if penalty([nearer[i] for i in missed]) < NEARER * height else []


def penalty(samples: Sequence[TargetSample]) -> float:
    """Return the sum of weight * |value|^2 of targets, as in the objective."""
    return float(sum(each.target.weight * float(each.value @ each.value) for each in samples))


def contradicting(
    transcription: Transcription, samples: list[TargetSample], z: Array, free: NDArray[np.bool_]
) -> list[int]:
    """Return which targets cannot all be met near z; none or at least two.

    Points beside z show which combinations of components stay the same. As these do not change, no z nearby makes all
    components, in units of their tolerances, smaller than their part in such combinations. Where that is longer than
    sqrt(T), one of the T targets is missed.
    """
    here = joined(samples)
    owners = np.repeat(np.arange(len(samples)), [sample.value.size for sample in samples])
    if here.size > MAX_COMPONENTS:
        return []
    changes = _changes(transcription, samples, z, free)
    if changes is None:
        return []
    tolerances = np.array([samples[i].target.tolerance for i in owners])
    part = constant_part(here / tolerances, changes / tolerances[:, None], 1 / tolerances)
    if float(np.linalg.norm(part)) <= np.sqrt(len(samples)):
        return []
    shares = np.array([np.linalg.norm(part[owners == i]) for i in range(len(samples))])
    found = np.flatnonzero(shares > MIN_SHARE * shares.max())
    return found.tolist() if found.size > 1 else []


def constant_part(values: Array, changes: Array, sizes: Array) -> Array:
    """Return the part of ``values`` (m,) in the combinations that ``changes`` (m, k) leave constant.

    A component that does not change at all, beside rounding of ``sizes`` (m,) + |values|, takes no part.
    """
    lengths = np.linalg.norm(changes, axis=1)
    moving = lengths > NO_CHANGE * (sizes + np.abs(values))
    part = np.zeros(values.size)
    if moving.sum() < 2:
        return part
    left, singular, _ = np.linalg.svd(changes[moving] / lengths[moving, None])
    constant = left[:, singular <= DEPENDENT * singular[0]]
    if constant.shape[1]:
        basis = np.linalg.qr(constant / lengths[moving, None])[0]
        part[moving] = basis @ (basis.T @ values[moving])
    return part


def joined(samples: Sequence[TargetSample]) -> Array:
    """Return the values of all targets, stacked (m,)."""
    return np.concatenate([sample.value for sample in samples])


def _changes(
    transcription: Transcription, samples: Sequence[TargetSample], z: Array, free: NDArray[np.bool_]
) -> Array | None:
    """Return the changes of the components from z to points beside it (m, k >= m); None if too few are simulated."""
    shooting, rng = transcription.shooting, np.random.default_rng(3)
    here, lower, upper = joined(samples), shooting.stacked("lower"), shooting.stacked("upper")
    changes = []
    for distance in np.geomspace(NEAREST, FURTHEST, here.size + MORE_SAMPLES):
        way = np.where(free, rng.standard_normal(z.size), 0.0)
        step = distance * shooting.stacked("scale") * way / (float(np.linalg.norm(way)) or 1.0)
        inside = (z + step >= lower) & (z + step <= upper)
        arrays = transcription.arrays(np.clip(z + np.where(inside, step, -step), lower, upper))
        if arrays.finite:
            beside = target_samples(transcription.rollout, arrays, [sample.function for sample in samples])
            changes.append(joined(beside) - here)
    return np.array(changes).T if len(changes) >= here.size else None
