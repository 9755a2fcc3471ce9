"""From velocities to displacements: impacts act from their instant on, then a pass removes what still overlaps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.dynamics.articulated.configuration_update import Made, arrival
from symphys.dynamics.articulated.forward_kinematics import Arrived
from symphys.dynamics.collision.contact_geometry import UNMOVED, Contact, Shift
from symphys.dynamics.contact.constraint import ContactRow, Side
from symphys.dynamics.contact.projection import Impulse
from symphys.dynamics.context import Scene
from symphys.dynamics.joints.assembly import Trees
from symphys.dynamics.joints.coordinate_constraint import AxisRow
from symphys.dynamics.joints.loop_closure import Displaced, Shifts, close_loops, displaced
from symphys.dynamics.momentum import Moved, Rates, States
from symphys.dynamics.motion import Motion, apply
from symphys.dynamics.pgs import Row
from symphys.dynamics.tracing.decorator import repeat, traced
from symphys.model.joints import linkages

Expr = Any
"""casadi SX, MX or DM"""


def displacements(
    scene: Scene,
    trees: Trees,
    rows: Sequence[Row],
    started: Sequence[Impulse],
    solved: States,
    given: Sequence[Impulse],
    duration: Expr,
) -> list[Displaced]:
    """Duration times the new velocities, less what impulses would have done before they act, at the carriers."""
    late = [_drift(motion, state, duration) for motion, state in zip(trees.motions, solved, strict=True)]
    if not scene.setting.scheme.time_of_impact:
        return late
    for each, *impulses in zip(rows, started, given, strict=True):
        for side, (body, carrier) in enumerate(zip(each.bodies, each.carriers, strict=True)):
            late[carrier] = _delayed(late[carrier], each.row, side, impulses, trees.motions[body].inverse_mid)
    return late


@traced
def _drift(motion: Motion, state: Moved, duration: Expr) -> Displaced:
    if state is None:
        return None
    if isinstance(state, Rates):
        return Rates(duration * state.numbers)
    return Shift(duration * state.velocity, duration * apply(motion.inverse_mid, state.angular))


@traced
def _delayed(late: Displaced, row: ContactRow, k: int, impulses: list[Impulse], turning: Expr) -> Displaced:
    """The displacement less that which the impulse on side k would have caused before it acts.

    What goes on from the last step has acted all the time, whatever rounding makes of the gap.
    """
    side, impulse = row.sides[k], impulses[1].minus(impulses[0].times(row.lasts))
    force, twist = impulse.linear(row.impulse_normal), impulse.angular(row.impulse_normal)
    early = row.delay * side.sign
    if isinstance(late, Rates) and side.reach is not None:
        return Rates(late.numbers - early * (ca.mtimes(side.reach.push, force) + ca.mtimes(side.reach.twist, twist)))
    assert isinstance(late, Shift)
    torque = ca.cross(side.impulse_arm, force) + twist
    return Shift(late.linear - early * side.inverse_mass * force, late.angular - early * apply(turning, torque))


@dataclass(frozen=True)
class Closed:
    """What the pass comes to.

    Attributes:
        shifts: displacements of bodies that are not part of a tree.
        arrived: of each body of a tree where it comes to.
        made: of each body of a tree what joints did to its displacement. Velocities are not touched.
    """

    shifts: Mapping[int, Shift]
    arrived: Mapping[int, Arrived]
    made: Mapping[int, Made]


def close_gaps(
    scene: Scene,
    trees: Trees,
    rows: Sequence[tuple[Row, Contact, Impulse]],
    joints: Sequence[Row],
    moved: Sequence[Displaced],
) -> Closed:
    """Gauss-Seidel on the displacements until no rigid contact overlaps, and those that last do not gape; then joints.

    What is on a tree is pushed along the tree's coordinates. Joints that close loops push along them too.
    """
    scheme = scene.setting.scheme
    rigid = tuple(
        (each, contact, _lasts(each.row, impulse)) for each, contact, impulse in rows if not each.row.law.soft
    )
    limits = tuple(each for each in joints if _of_tree(each))
    context = Passing(trees.motions, rigid, limits, scheme.push_out)
    before: Pushed = tuple(moved), tuple(ca.SX(0) for _ in rigid)
    along, _ = repeat(scheme.position_sweeps, _push_all, context, before)
    others = tuple(each for each in joints if not _of_tree(each))
    along, by_loops = close_loops(scheme.position_sweeps, trees.motions, others, along)
    return _closed(scene, trees, along, by_loops)


def _closed(scene: Scene, trees: Trees, along: Sequence[Displaced], by_loops: Sequence[Rates | None]) -> Closed:
    shifts = {i: each for i, each in enumerate(along) if isinstance(each, Shift)}
    arrived, made, joints = dict[int, Arrived](), dict[int, Made](), scene.world.joints
    for tree, chart in zip(linkages(joints), trees.charts, strict=True):
        ended = along[tree.root]
        assert isinstance(ended, Rates)
        own = tuple(None if link.joint is None else joints[link.joint] for link in tree.links)
        motions = [trees.motions[i] for i in tree.bodies]
        places, gained = arrival(tree, own, chart, motions, ended, by_loops[tree.root])
        arrived |= zip(tree.bodies, places, strict=True)
        made |= zip(tree.bodies, gained, strict=True)
    return Closed(shifts, arrived, made)


Pushed = tuple[tuple[Displaced, ...], tuple[Expr, ...]]
"""What pushes did to bodies and trees; pushes of contacts."""


@dataclass(frozen=True)
class Passing:
    """What stays the same over the sweeps of the pass over contacts.

    Attributes:
        motions: of the bodies.
        rigid: contacts, and whether they last.
        limits: of coordinates of trees.
        share: of an overlap that a step takes back.
    """

    motions: tuple[Motion, ...]
    rigid: tuple[tuple[Row, Contact, Expr], ...]
    limits: tuple[Row, ...]
    share: float


def _of_tree(each: Row) -> bool:
    return isinstance(each.row, AxisRow) and each.row.of_tree is not None


@traced
def _lasts(row: ContactRow, impulse: Impulse) -> Expr:
    """1 if a contact carried load and still does."""
    return ca.logic_and(row.lasts, impulse.normal > row.load)


def _push_all(context: Passing, state: Pushed) -> Pushed:
    """One pass over all rigid contacts and limits."""
    along, pushes = list(state[0]), list(state[1])
    for k, (each, contact, lasts) in enumerate(context.rigid):
        own = tuple(along[i] for i in each.carriers)
        moved = tuple(displaced(context.motions[i].held, a) for i, a in zip(each.bodies, own, strict=True))
        after, pushes[k] = _push(each.row, contact, lasts, moved, own, pushes[k], context.share)
        for i, own_after in zip(each.carriers, after, strict=True):
            along[i] = own_after
    for each in context.limits:
        along[each.carriers[0]] = _back(each.row, along[each.carriers[0]])
    return tuple(along), tuple(pushes)


@traced
def _push(
    row: ContactRow,
    contact: Contact,
    lasts: Expr,
    moved: Shifts,
    along: tuple[Displaced, ...],
    old: Expr,
    share: float,
) -> tuple[tuple[Displaced, ...], Expr]:
    gap = contact.meeting.gap_after(moved[0], moved[1] if len(moved) > 1 else UNMOVED) + row.slack
    free = old - share * gap * row.normal_mass * row.yields
    # at 0 the slope is that of ``free``: a body that exactly touches is held by the surface
    new = ca.if_else(ca.logic_or(lasts, free >= 0), free, 0)
    step = (new - old) * row.normal
    if row.same:
        after = along[0]
        for side in row.sides:
            after = _pushed(side, after, step)
        return tuple(after for _ in row.sides), new
    return tuple(_pushed(side, each, step) for side, each in zip(row.sides, along, strict=True)), new


def _pushed(side: Side, along: Displaced, step: Expr) -> Displaced:
    if isinstance(along, Rates) and side.reach is not None:
        return Rates(along.numbers + side.sign * apply(side.reach.push, step))
    assert isinstance(along, Shift)
    turn = apply(side.inverse_inertia, ca.cross(side.arm, step))
    return Shift(along.linear + side.sign * side.inverse_mass * step, along.angular + side.sign * turn)


@traced
def _back(row: AxisRow, along: Displaced) -> Rates:
    """The displacement along a tree's coordinates that takes a limit of one back to where it is kept."""
    assert isinstance(along, Rates) and row.of_tree is not None
    moved = ca.mtimes(row.of_tree.see, along.numbers)
    return Rates(along.numbers + ca.mtimes(row.of_tree.gain, row.fitting(moved)))
