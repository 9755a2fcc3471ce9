"""Displacements from velocities: impacts act from their instant on, then a pass removes the overlap that is left.

Angles of joints that count whole turns follow from these displacements.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca

from symphys.dynamics.articulated.configuration_update import JointCorrection, RotorCorrection, update_configuration
from symphys.dynamics.articulated.forward_kinematics import FinalPose
from symphys.dynamics.collision.contact_geometry import ZERO_DISPLACEMENT, Contact, Displacement
from symphys.dynamics.contact.body_term import BodyTerm
from symphys.dynamics.contact.constraint import ContactConstraint, ContactImpulse
from symphys.dynamics.contact.newton_start import contact_softness, solvable_groups, solve_together
from symphys.dynamics.context import State, StepContext
from symphys.dynamics.joints.assembly import JointPath, KinematicTrees
from symphys.dynamics.joints.coordinate_constraint import CoordinateConstraint
from symphys.dynamics.joints.joint_frames import JointFrames, free
from symphys.dynamics.joints.joint_impulse import JointImpulse
from symphys.dynamics.joints.loop_closure import Displacements, TreeDisplacement, close_loops, displaced
from symphys.dynamics.motion import BodyJacobian, PredictedMotion, apply
from symphys.dynamics.tracing.decorator import contiguous, repeat, traced
from symphys.dynamics.unknowns import (
    AllVelocities,
    GeneralizedVelocities,
    Iterate,
    Linearisation,
    PlacedConstraint,
    Velocities,
)
from symphys.maths.smoothing import either
from symphys.model.joints import kinematic_trees
from symphys.records import dataclass
from symphys.types import Expr

CENTRE_SCHEDULE = 0, 0
"""Steps of Newton's method on the gaps of contacts that share bodies."""


def displacements(
    context: StepContext,
    trees: KinematicTrees,
    constraints: Sequence[PlacedConstraint],
    started: Sequence[ContactImpulse],
    solved: AllVelocities,
    given: Sequence[ContactImpulse],
    duration: Expr,
) -> list[TreeDisplacement]:
    """Return duration times the new velocities, less the motion by impulses before they act, at the carriers."""
    late = [_drift(motion, state, duration) for motion, state in zip(trees.motions, solved, strict=True)]
    if not context.settings.scheme.time_of_impact:
        return late
    for each, *impulses in zip(constraints, started, given, strict=True):
        turning = tuple(trees.motions[body].inverse_mid for body in each.bodies)
        own = tuple(late[carrier] for carrier in each.carriers)
        for carrier, moved in zip(
            each.carriers, _remove_early_motions(own, each.constraint, impulses, turning), strict=True
        ):
            late[carrier] = moved
    return late


@traced
def _drift(motion: PredictedMotion, state: Velocities, duration: Expr) -> TreeDisplacement:
    if state is None:
        return None
    if isinstance(state, GeneralizedVelocities):
        return GeneralizedVelocities(duration * state.numbers)
    return Displacement(duration * state.velocity, duration * apply(motion.inverse_mid, state.angular))


@traced
def _remove_early_motions(
    late: tuple[TreeDisplacement, ...],
    constraint: ContactConstraint,
    impulses: list[ContactImpulse],
    turning: tuple[Expr, ...],
) -> tuple[TreeDisplacement, ...]:
    """Return the displacements less those which the impulse would have caused on each term before it acts.

    What goes on from the last step has acted all the time, whatever rounding makes of the gap.
    """
    impulse = impulses[1].minus(impulses[0].times(constraint.lasts))
    force, twist = impulse.linear(constraint.impulse_normal), impulse.angular(constraint.impulse_normal)
    found = list[TreeDisplacement]()
    for term, own, inverse in zip(constraint.terms, late, turning, strict=True):
        before = found[0] if constraint.same and found else own
        found.append(_remove_early_motion(before, term, constraint.delay * term.sign, (force, twist), inverse))
    return tuple(found[-1] for _ in found) if constraint.same else tuple(found)


def _remove_early_motion(
    late: TreeDisplacement, term: BodyTerm, early: Expr, impulse: tuple[Expr, Expr], turning: Expr
) -> TreeDisplacement:
    force, twist = impulse
    if isinstance(late, GeneralizedVelocities) and term.jacobian is not None:
        return GeneralizedVelocities(
            late.numbers
            - early
            * (ca.mtimes(term.jacobian.impulse_response, force) + ca.mtimes(term.jacobian.torque_response, twist))
        )
    assert isinstance(late, Displacement)
    torque = ca.cross(term.impulse_arm, force) + twist
    return Displacement(late.linear - early * term.inverse_mass * force, late.angular - early * apply(turning, torque))


@dataclass(frozen=True)
class CorrectedConfiguration:
    """Result of the position pass.

    Attributes:
        shifts: displacements of bodies that are not part of a tree.
        arrived: of each body of a tree where it comes to.
        made: of each body of a tree what joints did to its displacement. Velocities are not touched.
        turned: of each tree, by its root, what joints did to the displacements of its rotors.
        along: of each joint of a tree by how much its coordinates went on (count,) [rad] or [m].
        turning: (3,) [rad] of each body on other joints its rotation.
    """

    shifts: Mapping[int, Displacement]
    arrived: Mapping[int, FinalPose]
    made: Mapping[int, JointCorrection]
    turned: Mapping[int, RotorCorrection]
    along: Mapping[int, Expr]
    turning: Mapping[int, Expr]


def close_gaps(
    context: StepContext,
    trees: KinematicTrees,
    constraints: Sequence[tuple[PlacedConstraint, Contact, ContactImpulse]],
    joints: Sequence[PlacedConstraint],
    moved: Sequence[TreeDisplacement],
) -> CorrectedConfiguration:
    """Apply Gauss-Seidel to displacements until no rigid contact overlaps and none that lasts gapes; then joints.

    What is on a tree is pushed along the tree's coordinates. Joints that close loops push along them too.
    """
    scheme = context.settings.scheme
    # contacts: all gaps of a group together, then sweeps of pushes (19)
    rigid = tuple(
        (each, contact, _lasts(each.constraint, impulse))
        for each, contact, impulse in constraints
        if not each.constraint.law.soft
    )
    limits = tuple(each for each in joints if _on_tree_coordinate(each))
    fixed = PositionPass(trees.motions, rigid, limits, scheme.push_out)
    along = contiguous(tuple(moved)) if context.near else tuple(moved)
    before = _start(context, trees, fixed, along)
    pushed, _ = repeat(scheme.position_sweeps, _push_all, fixed, before)
    # joints that close loops, and limits outside trees
    others = tuple(each for each in joints if not _on_tree_coordinate(each))
    along, by_loops = close_loops(scheme.position_sweeps, trees.motions, others, pushed)
    return _corrected_configuration(context, trees, along, by_loops)


def _start(
    context: StepContext, trees: KinematicTrees, fixed: PositionPass, along: tuple[TreeDisplacement, ...]
) -> Pushed:
    """Return the start of the pass: where contacts share bodies, all of their gaps are closed together."""
    contacts = [each for each, _, _ in fixed.rigid]
    pushes = [
        replace(each, constraint=Push(each.constraint, contact, lasts, fixed.share, _jacobians(fixed, each)))
        for each, contact, lasts in fixed.rigid
    ]
    none = tuple(JointImpulse(ca.SX(0)) for _ in pushes)
    start: Any = along
    found = Iterate(start, none, none)
    for group in solvable_groups(context, contacts, along):
        found = solve_together(group, pushes, found, trees, contact_softness(group, contacts, trees), CENTRE_SCHEDULE)
    ended: Any = found.momenta
    return ended, tuple(each.numbers for each in found.impulses)


def _jacobians(fixed: PositionPass, each: PlacedConstraint) -> tuple[BodyJacobian | None, ...]:
    return tuple(fixed.motions[i].jacobian for i in each.bodies)


def _corrected_configuration(
    context: StepContext,
    trees: KinematicTrees,
    along: Sequence[TreeDisplacement],
    by_loops: Sequence[GeneralizedVelocities | None],
) -> CorrectedConfiguration:
    shifts = {i: each for i, each in enumerate(along) if isinstance(each, Displacement)}
    arrived, made, joints = dict[int, FinalPose](), dict[int, JointCorrection](), context.world.joints
    turned, moved = dict[int, RotorCorrection](), dict[int, Expr]()
    for tree, coordinates in zip(kinematic_trees(joints), trees.coordinates, strict=True):
        ended = along[tree.root]
        assert isinstance(ended, GeneralizedVelocities)
        own = tuple(None if link.joint is None else joints[link.joint] for link in tree.links)
        motions = [trees.motions[i] for i in tree.bodies]
        corrected = update_configuration(tree, own, coordinates, motions, ended, by_loops[tree.root])
        places, gained, turned[tree.root], rates = corrected
        moved |= {link.joint: rate for link, rate in zip(tree.links, rates, strict=True) if link.joint is not None}
        arrived |= zip(tree.bodies, places, strict=True)
        made |= zip(tree.bodies, gained, strict=True)
    loose = {i for k, joint in enumerate(joints) if k not in moved for i in joint.bodies}
    turning = {i: displaced(trees.motions[i].jacobian, along[trees.carriers[i]]).angular for i in sorted(loose)}
    return CorrectedConfiguration(shifts, arrived, made, turned, moved, turning)


Pushed = tuple[tuple[TreeDisplacement, ...], tuple[Expr, ...]]
"""Displacements of bodies and trees, and the accumulated pushes of contacts."""


@dataclass(frozen=True)
class PositionPass:
    """Motions and constraints, constant over the sweeps of the pass over contacts.

    Attributes:
        motions: of the bodies.
        rigid: contacts, and whether they last.
        limits: of coordinates of trees.
        share: of an overlap that a step takes back.
    """

    motions: tuple[PredictedMotion, ...]
    rigid: tuple[tuple[PlacedConstraint, Contact, Expr], ...]
    limits: tuple[PlacedConstraint, ...]
    share: float


def _on_tree_coordinate(each: PlacedConstraint) -> bool:
    return isinstance(each.constraint, CoordinateConstraint) and each.constraint.of_tree is not None


@traced
def _lasts(constraint: ContactConstraint, impulse: ContactImpulse) -> Expr:
    """Return 1 if a contact carried load and still does."""
    return ca.logic_and(constraint.lasts, impulse.normal > constraint.load)


def _push_all(fixed: PositionPass, state: Pushed) -> Pushed:
    """Make one pass over all rigid contacts and limits."""
    along, pushes = list(state[0]), list(state[1])
    for k, (each, contact, lasts) in enumerate(fixed.rigid):
        own = tuple(along[i] for i in each.carriers)
        moved = tuple(displaced(fixed.motions[i].jacobian, a) for i, a in zip(each.bodies, own, strict=True))
        after, pushes[k] = _push(each.constraint, contact, lasts, moved, own, pushes[k], fixed.share)
        for i, own_after in zip(each.carriers, after, strict=True):
            along[i] = own_after
    for each in fixed.limits:
        along[each.carriers[0]] = _enforce_limit(each.constraint, along[each.carriers[0]])
    return tuple(along), tuple(pushes)


@traced
def _push(
    constraint: ContactConstraint,
    contact: Contact,
    lasts: Expr,
    moved: Displacements,
    along: tuple[TreeDisplacement, ...],
    old: Expr,
    share: float,
) -> tuple[tuple[TreeDisplacement, ...], Expr]:
    law = PushLaw(constraint.near, constraint.normal_mass, constraint.separates, lasts, share)
    new = law.response(_gap_after(constraint, contact, moved), JointImpulse(old)).numbers
    return _displace_pair(constraint, along, (new - old) * constraint.normal), new


def _gap_after(constraint: ContactConstraint, contact: Contact, moved: Displacements) -> Expr:
    """Return the gap [m] after displacements, but for overlap that is rounding."""
    return contact.geometry.gap_after(moved[0], moved[1] if len(moved) > 1 else ZERO_DISPLACEMENT) + constraint.slack


@dataclass(frozen=True)
class PushLaw:
    """The push that closes a gap; an ``ImpulseLaw``.

    Attributes:
        near: 0 if the surfaces are too far apart to act.
        mass: effective mass along the normal [kg].
        separates: 1 if a push separates the surfaces.
        lasts: whether the gap is closed from either side.
        share: of an overlap that is taken back.
    """

    near: Expr
    mass: Expr
    separates: Expr
    lasts: Expr
    share: float

    def response(self, seen: Expr, old: JointImpulse) -> JointImpulse:
        """Implement ``ImpulseLaw.response``; ``seen``: the gap [m]."""
        # at 0 the slope is that of what is free: a body that exactly touches is held by the surface
        free = self._free(seen, old)
        return JointImpulse(self.near * ca.if_else(ca.logic_or(self.lasts, free >= 0), free, 0))

    def linearised(self, seen: Expr, old: JointImpulse, by: Linearisation) -> tuple[Expr, Expr]:
        """Implement ``ImpulseLaw.linearised``: a (1,) and B (1, 1)."""
        free, mass = self._free(seen, old), self.mass * self.separates
        acts = self.near * self.separates * either(self.lasts, by.within(free, mass))
        gives = 1 - acts + acts * mass * by.softness
        return (self.response(seen, old).numbers - old.numbers) / gives, acts * self.share * mass / gives

    def _free(self, gap: Expr, old: JointImpulse) -> Expr:
        """Return the push that closes the gap, of either sign."""
        return old.numbers - self.share * gap * (self.mass * self.separates)


def _displace_pair(
    constraint: ContactConstraint, along: tuple[TreeDisplacement, ...], step: Expr
) -> tuple[TreeDisplacement, ...]:
    """Return the displacements after a push (3,) of the first body."""
    if constraint.same:
        after = along[0]
        for term in constraint.terms:
            after = _displace(term, after, step)
        return tuple(after for _ in constraint.terms)
    return tuple(_displace(term, each, step) for term, each in zip(constraint.terms, along, strict=True))


@dataclass(frozen=True)
class Push:
    """The push of a contact as a constraint of ``newton_start``.

    Attributes:
        constraint, contact: of the pair.
        lasts: whether its gap is closed from either side.
        share: of an overlap that is taken back.
        jacobians: of its bodies.
    """

    constraint: ContactConstraint
    contact: Contact
    lasts: Expr
    share: float
    jacobians: tuple[BodyJacobian | None, ...]

    def rates(self, along: tuple[TreeDisplacement, ...]) -> Expr:
        """Return how far displacements part the surfaces (1,), to first order [m]."""
        parted = ca.SX(0)
        for term, moved in zip(self.constraint.terms, self._moved(along), strict=True):
            shift = moved.linear + ca.cross(moved.angular, term.arm)
            parted += term.sign * ca.dot(self.constraint.normal, shift)
        return parted

    def apply(self, along: tuple[TreeDisplacement, ...], impulse: JointImpulse) -> tuple[TreeDisplacement, ...]:
        """Return the displacements after a push."""
        return _displace_pair(self.constraint, along, impulse.numbers * self.constraint.normal)

    def project(
        self, along: tuple[TreeDisplacement, ...], old: JointImpulse
    ) -> tuple[tuple[TreeDisplacement, ...], JointImpulse]:
        """Return the displacements after ``_push``, and what all pushes come to."""
        after, new = _push(
            self.constraint, self.contact, self.lasts, self._moved(along), along, old.numbers, self.share
        )
        return after, JointImpulse(new)

    def seen(self, along: tuple[TreeDisplacement, ...]) -> Expr:
        """Return the gap after displacements (1,) [m]."""
        return _gap_after(self.constraint, self.contact, self._moved(along))

    def alone(self) -> PushLaw:
        """Implement ``VelocityConstraint.alone``."""
        contact = self.constraint
        return PushLaw(contact.near, contact.normal_mass, contact.separates, self.lasts, self.share)

    def _moved(self, along: tuple[TreeDisplacement, ...]) -> Displacements:
        return tuple(displaced(jacobian, own) for jacobian, own in zip(self.jacobians, along, strict=True))


def _displace(term: BodyTerm, along: TreeDisplacement, step: Expr) -> TreeDisplacement:
    if isinstance(along, GeneralizedVelocities) and term.jacobian is not None:
        return GeneralizedVelocities(along.numbers + term.sign * apply(term.jacobian.impulse_response, step))
    assert isinstance(along, Displacement)
    turn = apply(term.inverse_inertia, ca.cross(term.arm, step))
    return Displacement(along.linear + term.sign * term.inverse_mass * step, along.angular + term.sign * turn)


@traced
def _enforce_limit(constraint: CoordinateConstraint, along: TreeDisplacement) -> GeneralizedVelocities:
    """Return the displacement along a tree's coordinates that takes a limit of one back to where it is kept."""
    assert isinstance(along, GeneralizedVelocities) and constraint.of_tree is not None
    moved = ca.mtimes(constraint.of_tree.jacobian, along.numbers)
    return GeneralizedVelocities(
        along.numbers + ca.mtimes(constraint.of_tree.response, constraint.position_impulse(moved))
    )


def unwrapped_angles(
    context: StepContext, paths: Sequence[JointPath], closed: CorrectedConfiguration, duration: Expr
) -> State:
    """Return ``Joint.unwrapped`` of all joints that turn, at the end of a substep of ``duration`` [s].

    The coordinate at the start plus its change in the step is its angle to third order in the step. Poses give the
    angle exactly up to whole turns, whose number follows from this estimate, however far a step turns.
    """
    found = State()
    for index, (joint, path) in enumerate(zip(context.world.joints, paths, strict=True)):
        if joint.unwrapped is None:
            continue
        if index in closed.along:
            moved = closed.along[index]
        else:
            moved = _turned(path.frames, tuple(closed.turning[i] for i in joint.bodies), duration)
        found[joint.unwrapped] = _gone_on(path.values, moved)
    return found


@traced
def _gone_on(values: tuple[Expr, ...], moved: Expr) -> Expr:
    return ca.vertcat(*values) + moved


@traced
def _turned(frames: JointFrames, turning: tuple[Expr, ...], duration: Expr) -> Expr:
    """Return the change (count,) [rad] of the coordinates as the first body turned against the second."""
    middle, zero = frames.placed(duration / 2), ca.SX.zeros(3)
    angular = turning[0] if len(turning) == 1 else turning[0] - turning[1]
    return ca.vertcat(*(free(each, middle).forwards(zero, angular) for each in frames.joint.kind.coordinates))
