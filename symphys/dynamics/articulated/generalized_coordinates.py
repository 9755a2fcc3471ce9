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

from symphys.dynamics.articulated import spatial as screws
from symphys.dynamics.articulated.branches import Solved, Tree, TreeMatrix, axes_at, moving, solve, tree_matrix
from symphys.dynamics.articulated.impulse_response import Gain, Numbering, Placed, gains_of, held_of, numbering, spread
from symphys.dynamics.articulated.schur_complement import Inertia, Screw
from symphys.dynamics.momentum import Momentum, Rates
from symphys.dynamics.motion import Held, Motion, apply
from symphys.dynamics.tracing.decorator import traced
from symphys.model.joints import Linkage

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
        gains: of each coordinate; None where nothing acts along it.
        tree, matrix: its screws and its mass matrix.
        bodies: when velocities are seen.
    """

    free: Rates
    held: tuple[Held | None, ...]
    gains: tuple[Gain | None, ...]
    tree: Tree
    matrix: TreeMatrix
    bodies: tuple[Placed, ...]


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
    origin = motions[0].position
    courses = [motion.course() for motion in motions]
    seen, given = (axes_at(linkage, joints, courses, t, origin) for t in (middle, ca.SX(0)))
    tree = Tree(linkage, seen, given)
    parts = [_counted(motion, momentum, origin, middle) for motion, momentum in zip(motions, free, strict=True)]
    bodies, inertias, momenta = zip(*parts, strict=True)
    matrix = tree_matrix(tree, inertias)
    rates = _joined(numbering(tree), solve(tree, matrix, momenta))
    places = [
        (motion.position - origin, body) if on else None
        for motion, body, on in zip(motions, bodies, reached, strict=True)
    ]
    held = held_of(tree, matrix, places)
    gains = gains_of(tree, matrix, [acts(joint) for joint in joints])
    return Chart(Rates(rates), held, gains, tree, matrix, bodies)


def acts(joint: Any) -> bool:
    """Whether anything acts along a joint's coordinates."""
    return joint is not None and bool(joint.acting)


def body_momenta(chart: Chart, rates: Any) -> tuple[Momentum, ...]:
    """Of the bodies of a tree, from the rates that sweeps know of it."""
    return tuple(_momentum(*each) for each in zip(_moving(chart, rates), chart.bodies, strict=True))


def _moving(chart: Chart, rates: Any) -> tuple[Screw, ...]:
    return moving(chart.tree, chart.matrix, apart(numbering(chart.tree), rates.numbers)).screws


@traced
def _momentum(screw: Screw, body: Placed) -> Momentum:
    velocity, spin = screws.at_place(screw.parts, body.place)
    return Momentum(velocity, apply(body.inertia, spin))


@traced
def _counted(motion: Motion, free: Momentum, origin: Expr, middle: Expr) -> tuple[Placed, Inertia, Screw]:
    """A body at mid-step, its momentum at the start for what is seen at mid-step, and its free momentum."""
    counted, place, inertia = motion.position - origin, motion.centre().at(middle) - origin, motion.inertia_at(middle)
    momentum = screws.about_origin(counted, motion.mass * free.velocity, free.angular)
    return Placed(place, inertia), Inertia(screws.inertia_of(motion.mass, inertia, counted, place)), Screw(momentum)


@traced
def _joined(numbering: Numbering, rates: Solved) -> Expr:
    return spread(numbering, (rates.r, *rates.z))


@traced
@traced
def apart(numbering: Numbering, numbers: Expr) -> Solved:
    """What sweeps know of a tree, by its root and limbs."""
    r, *z = (numbers[list(each), 0] for each in numbering)
    return Solved(r, tuple(z))
