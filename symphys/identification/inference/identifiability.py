"""Directions of the shared numbers that the recordings do not determine, in words.

Each number has a unit: its scale, or its own size where that is larger. In these units the Jacobian, with the own
numbers eliminated and without priors of the shared ones, has a singular value for each direction, whose inverse is the
standard error along it. A direction is open where that is above ``OPEN_ERROR``: the recordings leave it open by more
than the numbers' own size. Above ``NO_INFORMATION_ERROR``, or where the singular value is rounding, there is no
information at all.

A basis of the open directions is brought into echelon form, so that numbers that have nothing to do with each other
fall apart. If n numbers share n - 1 open directions, one combination of them is determined: with logarithms of integer
weights a product, d log a = -d log b leaves a b.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from symphys.identification.fitting.robust_loss import RobustLoss
from symphys.identification.fitting.square_root import ROUNDING, eliminate, triangle
from symphys.identification.inference.uncertainty import Information
from symphys.identification.interface import RecordedResiduals, Rows
from symphys.results.identification.record import OpenDirection
from symphys.types import Array, Ints

OPEN_ERROR = 1.0
"""Standard error of a direction, in units of the numbers, above which it is not identifiable."""
ZERO_COMPONENT = 0.02
"""Size of a component of a direction, relative to the largest, that counts as zero."""
TRIED_EXPONENTS = (1, 2, 3)
"""Largest powers that are tried."""
NO_INFORMATION_ERROR = 1e3
"""Standard error, in units of the numbers, above which a direction has no information at all."""
TRIAL_DISTANCE = 0.1
"""Distance along a direction at which the claim of any value is tested, as a share of the numbers."""
SAME_RESIDUALS = 1e-3
"""Change of residuals, relative to that of one number alone, that counts as none."""
POWER_TOLERANCE = 0.03
"""Tolerance of a power, as a share of the largest."""


def open_directions(
    problem: RecordedResiduals,
    evaluated: Rows,
    shared: Array,
    own: Array,
    which: Ints,
    loss: RobustLoss,
    information: Information,
) -> tuple[OpenDirection, ...]:
    """Find the open directions among the shared numbers that no bound holds, without shared priors."""
    free = np.flatnonzero(information.free_shared)
    if not free.size:
        return ()
    parameters = problem.shared
    units = np.maximum(np.abs(shared), parameters.scale)[free]
    rows = reduced_rows(problem, evaluated, which, loss, information)[:, free] * units
    _, sizes, basis = np.linalg.svd(rows)
    wanted = sizes < 1 / OPEN_ERROR
    if not wanted.any():
        return ()
    found, directions = [], echelon(basis[wanted])
    for members, part in components(directions):
        error = direction_error(rows, directions[part], float(sizes[0]))
        moves = own_moves(problem, information, free, units / parameters.scale[free], directions[part])
        named, open_part = free[members], directions[np.ix_(part, members)] * units[members]
        text = describe(problem, shared, own, which, named, open_part, moves)
        if np.isfinite(error):
            text = f"{text}, or nearly so: the standard error is {error:.2g} times their size"
        prior = bool(np.isfinite(parameters.prior_deviation[named]).any())
        names = tuple(parameters.names[i] for i in named)
        advised = advice([parameters.sets[i] for i in named])
        found.append(OpenDirection(names, tuple(moves), text, advised, error, prior))
    return tuple(found)


def reduced_rows(
    problem: RecordedResiduals, evaluated: Rows, which: Ints, loss: RobustLoss, information: Information
) -> Array:
    """Compute (s, s) R with R'R the Schur complement, by orthogonal elimination: no squares lose digits."""
    s, o = len(problem.shared.names), len(problem.own.names)
    stacked = [np.zeros((s, s))]
    prior = 1 / problem.own.prior_deviation
    for at, (k, (r, by_shared, by_own)) in enumerate(zip(which, evaluated, strict=True)):
        weight = np.sqrt(loss.weight(r))[:, None]
        free = information.free_own[at]
        own_rows = np.concatenate([weight * by_own, np.diag(prior[k])])[:, free] * problem.own.scale[k][free]
        shared_rows = np.concatenate([weight * by_shared, np.zeros((o, s))])
        both = np.concatenate([shared_rows, own_rows], axis=1)
        stacked.append(triangle(eliminate(both[None], s).left[0]))
    return triangle(np.concatenate(stacked))


def direction_error(rows: Array, directions: Array, largest: float) -> float:
    """Return the standard error along the least determined of directions (d, n); inf without information."""
    span = np.linalg.qr(directions.T)[0]
    size = float(np.linalg.svd(rows @ span, compute_uv=False)[-1])
    return np.inf if size <= max(ROUNDING * largest, 1 / NO_INFORMATION_ERROR) else 1 / size


def echelon(basis: Array) -> Array:
    """Bring directions (d, n) into echelon form by full pivoting; the largest component of each is 1."""
    rows = basis.copy()
    used: list[int] = []
    for i in range(len(rows)):
        left = np.abs(rows[i:]).copy()
        left[:, used] = 0
        at, pivot = divmod(int(np.argmax(left)), left.shape[1])
        rows[[i, i + at]] = rows[[i + at, i]]
        rows[i] /= rows[i, pivot]
        others = np.arange(len(rows)) != i
        rows[others] -= np.outer(rows[others, pivot], rows[i])
        used.append(pivot)
    rows /= np.max(np.abs(rows), axis=1, keepdims=True)
    return np.where(np.abs(rows) < ZERO_COMPONENT, 0.0, rows)


def components(rows: Array) -> list[tuple[Ints, Ints]]:
    """Group coupled numbers and directions: (members, rows) of each group, by index."""
    left, found = list(range(len(rows))), []
    while left:
        part, members = [left.pop(0)], np.zeros(rows.shape[1], bool)
        members |= rows[part[0]] != 0
        grown = True
        while grown:
            more = [i for i in left if np.any(members & (rows[i] != 0))]
            grown = bool(more)
            part += more
            left = [i for i in left if i not in more]
            members |= np.any(rows[part] != 0, axis=0)
        found.append((np.flatnonzero(members), np.array(sorted(part))))
    return found


def own_moves(problem: RecordedResiduals, information: Information, free: Ints, units: Array, rows: Array) -> list[str]:
    """Name the own numbers that follow directions (d, n) by more than a share of their scale in most recordings."""
    moves = np.einsum("kos,ds->kdo", information.gain[:, :, free] * units, rows)
    often = np.median(np.max(np.abs(moves), axis=1), axis=0) if moves.size else np.zeros(0)
    return [name for name, size in zip(problem.own.names, often, strict=True) if size > ZERO_COMPONENT]


def describe(
    problem: RecordedResiduals, shared: Array, own: Array, which: Ints, named: Ints, rows: Array, moves: list[str]
) -> str:
    """Describe directions (d, n) of the shared numbers at the indices ``named``, in their own units."""
    names = [problem.shared.names[i] for i in named]
    if moves:
        every = f"{listed(moves)} of each recording"
        return f"{listed(names)} can change together with {every} without an effect on what was measured"
    if len(rows) == len(named):
        return f"{listed(names)} {'has' if len(names) == 1 else 'have'} no effect on what was measured"
    if len(rows) < len(named) - 1:
        return f"{listed(names)} can change together without an effect on what was measured"
    if np.all(shared[named] != 0):
        powers = whole_powers(kernel(rows / shared[named]))
        exponents = rows / shared[named]
        if powers is not None:
            exponents = exponents - np.outer(exponents @ powers, powers) / (powers @ powers)
        far = shared[named] * np.exp(TRIAL_DISTANCE * exponents / np.max(np.abs(exponents), axis=1, keepdims=True))
        if powers is not None and unchanged(problem, shared, own, which, named, far):
            kind = "their product" if np.all(powers == 1) else "the ratio" if ratio(powers) else "the combination"
            return f"{listed(names)} appear only as {kind} {monomial(names, powers)}"
    weights = kernel(rows)
    weights = weights / weights[np.argmax(np.abs(weights))]
    sums = " + ".join(f"{weight:.3g} {name}" for weight, name in zip(weights, names, strict=True)).replace("+ -", "- ")
    size = np.maximum(np.abs(shared), problem.shared.scale)[named]
    far = shared[named] + TRIAL_DISTANCE * rows / np.max(np.abs(rows / size), axis=1, keepdims=True)
    local = "" if unchanged(problem, shared, own, which, named, far) else " near the estimate"
    return f"{listed(names)} appear only as {sums}{local}"


def unchanged(problem: RecordedResiduals, shared: Array, own: Array, which: Ints, named: Ints, far: Array) -> bool:
    """Return whether points (d, n) along the directions have the residuals of the estimate.

    What is open by the Jacobian is open near the estimate; a product is claimed of every value.
    """
    here = np.concatenate(problem.residuals(shared, own, which))

    def change(values: Array) -> float:
        there = shared.copy()
        there[named] = values
        if np.any((there < problem.shared.lower) | (there > problem.shared.upper)):
            return np.inf
        return float(np.linalg.norm(np.concatenate(problem.residuals(there, own, which)) - here))

    for point in far:
        at = int(np.argmax(np.abs(point - shared[named])))
        alone = shared[named].copy()
        alone[at] = point[at]
        if not change(point) <= SAME_RESIDUALS * change(alone):
            return False
    return True


def kernel(directions: Array) -> Array:
    """Compute the direction (n,) orthogonal to (n - 1, n) directions."""
    return np.asarray(np.linalg.svd(directions)[2][-1])


def whole_powers(weights: Array) -> Array | None:
    """Return (n,) small integers, the first above 0, proportional to weights (n,); None without any."""
    for most in TRIED_EXPONENTS:
        powers = weights / weights[np.argmax(np.abs(weights))] * most
        near = np.round(powers)
        if np.all(np.abs(powers - near) <= POWER_TOLERANCE * most) and np.all(near != 0):
            return np.asarray(near * np.sign(near[0]))
    return None


def ratio(powers: Array) -> bool:
    """Whether a monomial is the ratio of two numbers."""
    return bool(len(powers) == 2 and sorted(powers) == [-1, 1])


def monomial(names: list[str], powers: Array) -> str:
    """Write ``mass * friction / radius^2``."""
    parts = {True: [], False: []}  # type: dict[bool, list[str]]
    for name, power in zip(names, powers, strict=True):
        parts[power > 0].append(name if abs(power) == 1 else f"{name}^{abs(int(power))}")
    below = parts[False]
    under = f" / {below[0]}" if len(below) == 1 else f" / ({' * '.join(below)})" if below else ""
    return " * ".join(parts[True]) + under


def listed(names: list[str]) -> str:
    """Write ``a, b and c``."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


ADVICE: dict[str, tuple[str, ...]] = {
    "record a collision with a body of known mass, or a motion under a known force or a motor's torque: under gravity "
    "and contact with fixed surfaces alone, masses cancel": ("mass", "density"),
    "record spins about several axes that a known torque or an off-centre collision changes": ("inertia", "moments"),
    "record tosses that spin freely about two axes, or let the body rest in several poses": (
        "center",
        "centre",
        "com",
        "center_of_mass",
        "centre_of_mass",
    ),
    "record a long slide, or a toss that lands with speed along the ground and little spin": ("friction", "mu"),
    "record bounces from several heights, up to the second impact": ("restitution", "bounce"),
    "record a long roll without sliding": ("rolling", "rolling_friction"),
    "record a spin about the vertical on one contact": ("torsional", "torsion", "torsional_friction", "spinning"),
    "record free flight, with lengths that are measured by a ruler": ("gravity",),
    "record a fall of known height, or measure a length by a ruler: without gravity or a known length, scales are "
    "free": ("scale", "length_scale", "size", "radius", "half_size", "length", "width", "thickness"),
    "record the body at rest in two places, one of them known": (
        "position",
        "offset",
        "height",
        "tilt",
        "x",
        "y",
        "z",
    ),
    "let the joint swing out freely from several speeds": ("damping", "drag", "viscosity"),
    "let the joint swing out to rest: its last swings show the dry friction": ("dry_friction", "coulomb", "armature"),
    "record a deflection under a known force, or the period of free swings with a known mass": ("stiffness", "spring"),
    "record the motor's answer to steps of known torque, with a known inertia": ("gain", "torque", "kp", "kd", "motor"),
    "record fast changes of the command: delays act only where something changes": ("delay", "latency", "time_offset"),
}
"""The advice by the words of a quantity that need it."""
GENERAL = "record motions that differ in this quantity alone, hold it at a known value, or give it a prior"


def advice(quantities: Iterable[str]) -> str:
    """Return the recording to make for each kind among quantities such as ``cube.mass``, in their order."""
    found = []
    for quantity in quantities:
        last = quantity.split(".")[-1].split("[")[0].strip().lower()
        fitting = [(len(word), text) for text, words in ADVICE.items() for word in words if is_kind(last, word)]
        said = max(fitting, default=(0, GENERAL))[1]
        if said not in found:
            found.append(said)
    specific = [text for text in found if text != GENERAL] or found
    joined = "; or ".join(specific)
    return joined[0].upper() + joined[1:]


def is_kind(name: str, word: str) -> bool:
    """Whether a name is the word, or ends or begins with it as a word of its own."""
    return name == word or name.endswith(("_" + word, " " + word)) or name.startswith(word + "_")
