"""The velocities of a tree of bodies in the coordinates that its joints leave, and what impulses do to them.

Velocities are seen at the middle of a stretch and impulses given at its start, as rows of joints are (``joint_rows``):
a body's velocity is ``see`` times the rates of the coordinates, with arms at the middle; impulses of locks, which act
at the start on one point of both sides, do nothing along the free motions of the start. So
sum of free_motion . (momentum - free momentum) = sum of free_motion . impulses,  free motions being those of the start,
holds whatever the locks give: joints are held exactly, and the sweeps know contacts, motors and limits only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.joints import Linkage
from symphys.motion import Held, Motion, apply
from symphys.step import screws
from symphys.step.elimination import Sparse
from symphys.step.limbs import Limbs, matrix_of
from symphys.step.momentum import Momentum, Rates

Expr = Any
"""casadi SX"""


@dataclass(frozen=True)
class Chart:
    """A tree over a stretch.

    Sweeps know the rates of the root and what those of limbs have beside what they do as the root moves (``limbs``):
    all here is by these numbers.

    Attributes:
        free: them without any impulse of the stretch.
        held: of each link: how its body moves with the rates, and what impulses on it do to them; None for bodies on
            which nothing acts but the tree's own joints.
        gains: for each coordinate its rate by the numbers (1, n), and what a unit impulse along it does to them (n,);
            None where nothing acts along it.
        rates: (n, n) the numbers to the rates of the coordinates.
        seen: (6,) screw of each coordinate at mid-step.
        places: (3,) of each body at mid-step, from the origin of the screws.
        inertias: (3, 3) of each body, world frame, at mid-step.
    """

    free: Rates
    held: tuple[Held | None, ...]
    gains: tuple[tuple[Expr, Expr] | None, ...]
    rates: Expr
    seen: tuple[Expr, ...]
    places: tuple[Expr, ...]
    inertias: tuple[Expr, ...]


def make_chart(
    linkage: Linkage,
    joints: screws.Joints,
    reached: Sequence[bool],
    motions: Sequence[Motion],
    free: Sequence[Momentum],
    middle: Expr,
) -> Chart:
    """The chart of a tree.

    Args:
        linkage: the tree.
        joints: of its links, as are the other sequences.
        reached: whether anything but the tree's own joints acts on the body.
        motions: what the bodies do.
        free: their momenta without any impulse of the stretch.
        middle: when velocities are seen [s].
    """
    start, origin, n = ca.SX(0), motions[0].position, linkage.size
    seen, given = (screws.screws(linkage, joints, motions, t, origin) for t in (middle, start))
    places, counted = ([m.centre().at(t) - origin for m in motions] for t in (middle, start))
    inertias = [_inertia(motion, middle) for motion in motions]
    parts = zip(motions, inertias, counted, places, strict=True)
    masses = [screws.inertia_of(m.mass, *rest) for m, *rest in parts]
    matrix = Limbs(screws.mass_matrix(linkage, masses, seen, given), screws.limbs(linkage))
    momenta = [
        screws.about_origin(place, motion.mass * momentum.velocity, momentum.angular)
        for place, motion, momentum in zip(counted, motions, free, strict=True)
    ]
    held = []
    for k, path in enumerate(screws.paths(linkage)):
        see = _see(matrix.seen({j: seen[j] for j in path}), places[k], n)
        response = _response(matrix, {j: given[j] for j in path}, counted[k], n) if reached[k] else None
        held.append(None if response is None else Held(see, inertias[k], *response))
    acting = {k for link, joint in zip(linkage.links, joints, strict=True) for k in screws.own(link) if acts(joint)}
    gains = tuple(_gain(matrix, k, n) if k in acting else None for k in range(n))
    free_rates = Rates(dense(matrix.solve(screws.along_screws(linkage, given, momenta)), n))
    rates = matrix_of(matrix.follows, n)
    return Chart(free_rates, tuple(held), gains, rates, tuple(seen), tuple(places), tuple(inertias))


def _gain(matrix: Limbs, k: int, n: int) -> tuple[Expr, Expr]:
    rate = matrix.seen({k: ca.SX(1)})
    row = ca.SX(1, n)
    for j, value in rate.items():
        row[0, j] = value
    return row, dense(matrix.solve({k: ca.SX(1)}), n)


def acts(joint: Any) -> bool:
    """Whether anything acts along a joint's coordinates."""
    return joint is not None and bool(joint.acting)


def _inertia(motion: Motion, t: Expr) -> Expr:
    """(3, 3), world frame: the inverse of what rows take for the inverse."""
    inverse = motion.inverse_inertia(t)
    return ca.SX.eye(3) / inverse if ca.SX(inverse).is_scalar() else ca.inv_minor(inverse)


def _see(seen: dict[int, Expr], place: Expr, n: int) -> Expr:
    """(6, n): velocity above angular velocity."""
    columns = [ca.vertcat(*screws.at_place(seen[k], place)) if k in seen else ca.SX(6, 1) for k in range(n)]
    return ca.sparsify(ca.horzcat(*columns))


def _response(matrix: Limbs, given: dict[int, Expr], place: Expr, n: int) -> tuple[Expr, Expr]:
    """(n, 3) each: what unit impulses at the centre of mass, and unit torque impulses, do to the rates."""
    unit, zero = ca.SX.eye(3), ca.SX.zeros(3)
    found = []
    for pairs in ([(unit[:, i], zero) for i in range(3)], [(zero, unit[:, i]) for i in range(3)]):
        rights = [{k: ca.dot(s, screws.about_origin(place, *pair)) for k, s in given.items()} for pair in pairs]
        solved = [matrix.solve({k: v for k, v in right.items() if not v.is_zero()}) for right in rights]
        found.append(ca.horzcat(*(dense(each, n) for each in solved)))
    return found[0], found[1]


def dense(entries: Sparse, n: int) -> Expr:
    """(n,) of a sparse vector, zeros left out."""
    found = ca.SX(n, 1)
    for k, value in entries.items():
        found[k] = value
    return found


def body_momenta(linkage: Linkage, chart: Chart, rates: Rates) -> tuple[Momentum, ...]:
    """Of the bodies of a tree."""
    numbers = apply(chart.rates, rates.numbers)
    amounts = {k: numbers[k] for k in range(linkage.size)}
    moving = screws.summed_down(linkage, chart.seen, amounts)
    found = []
    for screw, place, inertia in zip(moving, chart.places, chart.inertias, strict=True):
        velocity, spin = screws.at_place(screw, place)
        found.append(Momentum(velocity, apply(inertia, spin)))
    return tuple(found)
