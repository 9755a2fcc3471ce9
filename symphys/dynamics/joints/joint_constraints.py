"""The constraints of one joint over a substep: evaluated at its middle, applied at its start, which keeps energy.

Impulses act on one point of both bodies. With both at the middle a pendulum would lose a fifth of its energy in five
seconds. A rigid lock asks for zero velocity, and the position pass takes back what is left of its error, of third order
in a step. Asking for -error / dt (SHAKE) would do both at once, but feeds errors back through the forces that the
sweeps start from, which is unstable as soon as these do not converge by half in a step: chains of four then burst.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf, isfinite
from typing import Any

import casadi as ca

from symphys.dynamics.contact.body_term import BodyTerm, Motions
from symphys.dynamics.contact.oscillator import SpringLaw, response, spring_law
from symphys.dynamics.contact.preparation import TIE_DISTANCE
from symphys.dynamics.context import StepSettings
from symphys.dynamics.joints.coordinate_constraint import CoordinateConstraint, TreeCoordinate, affine_law, velocity_law
from symphys.dynamics.joints.joint_frames import JointFrames, free, locked
from symphys.dynamics.joints.joint_impulse import Directions, mobility, speeds
from symphys.dynamics.joints.locked_directions import LastingForce, LockConstraint, inverse
from symphys.dynamics.tracing.decorator import traced
from symphys.dynamics.unknowns import Momentum
from symphys.maths.smoothing import at_least, at_most, clip
from symphys.model.joints import AffineMotor, Joint, JointCoupling, Servo, Spring, TorqueMotor, VelocityMotor
from symphys.records import dataclass
from symphys.types import Expr

NO_STRIKE = ca.SX(0)
REDUNDANT_MOBILITY_SHARE = 1e-6
"""Added to the mobility of a lock, as a share of that of both bodies without their trees."""
ADDED_MASS_SHARE = 0.27
"""Effective mass that a spring adds, as a share of k dt^2; with 1/4 leapfrog would be at the edge of stability."""
MIN_STRIKE_STEP = 1e-4
"""[rad], [m] in a step: what comes to a limit faster than that strikes it."""


@dataclass(frozen=True)
class SubstepTimes:
    """Its length and the time over which forces act as impulses in it [s]; see ``substep``."""

    duration: Expr
    kick: Expr

    @property
    def lag(self) -> Expr:
        """Return the part of ``kick`` [s] that lies before the substep."""
        return self.kick - self.duration / 2


@dataclass(frozen=True)
class Command:
    """The command of a motor.

    Attributes:
        value: of the command in the step.
        before: what the command of the step before gave by itself [N m], [N]; it acts until this step begins.
    """

    value: Expr
    before: Expr


@dataclass(frozen=True)
class CoordinateTerms:
    """Terms common to all constraints along a coordinate.

    Attributes:
        terms, velocity_directions, impulse_directions: as of any constraint.
        value: [rad] or [m].
        rate: at the middle of the substep, before any impulse of it.
        rate_now, rate_due: at its start, and at its middle if forces stay what they were.
        mobility: inverse of the effective mass.
        same, of_tree: see ``CoordinateConstraint``.
    """

    terms: tuple[BodyTerm, ...]
    velocity_directions: Directions
    impulse_directions: Directions
    value: Expr
    rate: Expr
    rate_now: Expr
    rate_due: Expr
    mobility: Expr
    same: bool
    of_tree: TreeCoordinate | None


@traced
def lock_constraint(
    frames: JointFrames, motions: Motions, substep: SubstepTimes, same: bool, near: Expr | None
) -> LockConstraint:
    """Return the locked directions of a joint; of a soft one each is a spring and damper on its own effective mass.

    ``near``: (k,) the coordinates of one that holds screws, at the start.
    """
    # directions at mid-step and of impulses, mobility and error
    joint, start, middle = frames.joint, ca.SX(0), substep.duration / 2
    now = frames.placed(start)
    terms, seen, given = frames.terms(motions, middle, start), locked(joint, frames.placed(middle)), locked(joint, now)
    k, error = regular_mobility(terms, seen, same), joint.kind.errors(now, near)
    softness, target, lasting = ca.SX(k.size1(), 1), ca.SX(k.size1(), 1), None
    # soft joint: a spring and damper along each direction (10)
    if joint.soft:
        law = _spring_law(joint, substep)
        at_start = ca.diag(regular_mobility(frames.terms(motions, start, start), given, same))
        rate, due = _path_rates(frames, motions, terms, (given, seen))
        before = rate - 2 * substep.lag / substep.duration * (due - rate)
        softness, target = at_start / law.b, -(law.stiff * error + law.c * before) / law.b
        lasting = LastingForce(substep.kick, -law.end / at_start, -law.end_before * before / at_start)
    return LockConstraint(
        terms=terms,
        velocity_directions=seen,
        impulse_directions=given,
        mass=inverse(k + ca.diag(softness)),
        softness=softness,
        target=target,
        error=error,
        axes=now.a,
        same=same,
        lasting=lasting,
    )


@traced
def lock_at_impact(frames: JointFrames, motions: Motions, momenta: tuple[Any, ...], same: bool) -> LockConstraint:
    """Return the constraint of locked directions at an impact: it changes no velocity unless something else does."""
    now = ca.SX(0)
    placed = frames.placed(now)
    terms, seen = frames.terms(motions, now, now), locked(frames.joint, placed)
    k = regular_mobility(terms, seen, same)
    zero = ca.SX(k.size1(), 1)
    return LockConstraint(terms, seen, seen, inverse(k), zero, speeds(terms, seen, momenta), zero, placed.a, same)


def regular_mobility(terms: tuple[BodyTerm, ...], seen: Directions, same: bool) -> Expr:
    """Return the mobility (n, n), made regular where a tree locks directions already, as in a parallelogram."""
    k = mobility(terms, seen, same)
    if all(term.jacobian is None for term in terms):
        return k
    apart = tuple(replace(term, jacobian=None) for term in terms)
    return k + REDUNDANT_MOBILITY_SHARE * ca.diag(ca.diag(mobility(apart, seen, False)))


def _spring_law(joint: Joint, substep: SubstepTimes) -> SpringLaw:
    """Return the law of a soft joint along each of its locked directions."""
    omega, ratio = 2 * ca.pi * joint.frequency, joint.damping
    return spring_law(response(omega, ratio, substep.duration), response(omega, -ratio, 2 * substep.lag))


def _path_rates(
    frames: JointFrames, motions: Motions, terms: tuple[BodyTerm, ...], directions: tuple[Directions, Directions]
) -> tuple[Expr, Expr]:
    """Return rates (n,) along directions at the start of the substep, and at its middle under the last forces."""
    start, (given, seen) = ca.SX(0), directions
    before = tuple(Momentum(m.velocity, m.momentum_k) for m in motions)
    due = tuple(Momentum(m.mid_velocity, m.mid_momentum) for m in motions)
    now = tuple(replace(term, jacobian=None) for term in frames.terms(motions, start, start))
    return speeds(now, given, before), speeds(tuple(replace(term, jacobian=None) for term in terms), seen, due)


@traced
def coordinate_value(frames: JointFrames, k: int, near: Expr) -> Expr:
    """Return coordinate ``k`` of a joint at the start of a substep [rad] or [m]; see ``Joint.value``."""
    return frames.joint.value(k, frames.placed(ca.SX(0)), near)


@traced
def coordinate_terms(
    frames: JointFrames,
    k: int,
    motions: Motions,
    momenta: tuple[Any, ...],
    duration: Expr,
    place: tuple[int, Any] | bool,
    value: Expr,
) -> CoordinateTerms:
    """Return the terms of coordinate ``k`` of a joint over a substep.

    Args:
        frames: of the joint.
        k: which of its coordinates.
        motions: of its bodies.
        momenta: the velocities, before any impulse of the substep.
        duration: of the substep [s].
        place: of a joint of a tree: the index of its first coordinate, and the responses of the tree's coordinates;
            else whether both bodies are of one tree.
        value: of the coordinate at the start, see ``coordinate_value``.
    """
    # directions and rates of the coordinate at the start and at mid-step
    start, middle, coordinate = ca.SX(0), duration / 2, frames.joint.kind.coordinates[k]
    now, terms = frames.placed(start), frames.terms(motions, middle, start)
    seen, given = free(coordinate, frames.placed(middle)), free(coordinate, now)
    rate_now, rate_due = _path_rates(frames, motions, terms, (given, seen))
    if isinstance(place, bool):
        rate, k_of = speeds(terms, seen, momenta), mobility(terms, seen, place)
        return CoordinateTerms(terms, seen, given, value, rate, rate_now, rate_due, k_of, place, None)
    # coordinate of a tree: its Jacobian and response are those of the tree
    index, responses = place[0] + k, place[1]
    jacobian, response = responses[index]
    rate = ca.mtimes(jacobian, momenta[0].numbers)
    return CoordinateTerms(
        terms,
        seen,
        given,
        value,
        rate,
        rate_now,
        rate_due,
        ca.mtimes(jacobian, response),
        True,
        TreeCoordinate(jacobian, response),
    )


@traced
def motor_constraint(
    settings: StepSettings, joint: Joint, at: CoordinateTerms, command: Command, substep: SubstepTimes
) -> CoordinateConstraint:
    """Return the constraint of a motor; bounds of its torque are rounded off over smoothing times effective mass."""
    motor, width = joint.motor, settings.smoothing / at.mobility
    if isinstance(motor, AffineMotor):
        return _affine(settings, motor, at, command, substep)
    if isinstance(motor, TorqueMotor):
        return _drive_constraint(at, commanded_torque(motor, command.value, settings.smoothing), command, substep)
    assert isinstance(motor, Servo | VelocityMotor)
    aim = command.value
    wanted = servo_velocity(motor, aim, at.value, settings.smoothing) if isinstance(motor, Servo) else aim
    target = clip(wanted, -motor.velocity, motor.velocity, settings.smoothing)
    most = motor.torque * substep.kick
    return _constraint(at, velocity_law(target, at.mobility), -most, most, width)


def commanded_torque(motor: TorqueMotor | AffineMotor, given: Expr, smoothing: Expr = 0, width: Expr = 0) -> Expr:
    """Return the torque or force of a motor by its command alone [N m], [N].

    ``width`` smooths the bounds of its force.
    """
    if isinstance(motor, TorqueMotor):
        return clip(given, -motor.torque, motor.torque, smoothing)
    for end, held in zip(motor.command_range or (), (at_least, at_most), strict=False):
        given = held(given, end, smoothing) if isfinite(end) else given
    drive = motor.gear * (motor.gain * given + motor.offset)
    if motor.passive:
        for force, held in zip(_force_ends(motor), (at_least, at_most), strict=True):
            drive = drive if force is None else held(drive, force, width)
    return drive


def _drive_constraint(
    at: CoordinateTerms, drive: Expr, command: Command, substep: SubstepTimes
) -> CoordinateConstraint:
    """Return the constraint of a motor that gives ``drive`` [N m] in the substep, and the drive before over the lag."""
    law = affine_law(-_impulse(drive, command, substep), ca.SX(0), at.mobility)
    return _constraint(at, law, None, None, ca.SX(0), drive=drive)


def _impulse(drive: Expr, command: Command, substep: SubstepTimes) -> Expr:
    """Return the drive of commands by themselves: each acts from the start of its step to the end."""
    return substep.lag * command.before + substep.duration / 2 * drive


def _affine(
    settings: StepSettings, motor: AffineMotor, at: CoordinateTerms, command: Command, substep: SubstepTimes
) -> CoordinateConstraint:
    """Return the constraint of a torque affine in command, coordinate and rate.

    The last two act as spring and damper.
    """
    gear, kick, width, ends = motor.gear, substep.kick, settings.smoothing / at.mobility, _force_ends(motor)
    drive = commanded_torque(motor, command.value, settings.smoothing, width / kick)
    if motor.passive:
        return _drive_constraint(at, drive, command, substep)
    pull, slope = _spring(settings, at, substep, Spring(gear**2 * motor.kp, gear**2 * motor.kv))
    law = affine_law(pull - _impulse(drive, command, substep), slope, at.mobility)
    low, high = (None if end is None else kick * end for end in ends)
    return _constraint(at, law, low, high, width, drive=drive, jump=drive - command.before)


def _force_ends(motor: AffineMotor) -> tuple[Expr | None, Expr | None]:
    """Return the least and the largest force behind the gear; None where there is none."""
    low, high = motor.force_range or (-inf, inf)
    if isfinite(low) and isfinite(high):
        return ca.fmin(motor.gear * low, motor.gear * high), ca.fmax(motor.gear * low, motor.gear * high)
    turned = isinstance(motor.gear, int | float) and motor.gear < 0
    ends = (high, low) if turned else (low, high)
    return tuple(motor.gear * end if isfinite(end) else None for end in ends)  # type: ignore[return-value]


def servo_velocity(servo: Servo, command: Expr, value: Expr, smoothing: Expr) -> Expr:
    """Return the target of a servo without its bounds; rounding its range changes velocities by the smoothing."""
    if servo.range is not None:
        command = clip(command, -servo.range, servo.range, smoothing / servo.gain)
    return servo.gain * (command - value)


@traced
def lower_limit(
    settings: StepSettings, joint: Joint, at: CoordinateTerms, command: Command, substep: SubstepTimes
) -> CoordinateConstraint:
    """Return the constraint of a lower limit: it may be reached within the substep, not passed, and pushes only.

    What is beyond it is taken back by the position pass, without velocity.
    """
    left, strikes = at.value - joint.limits.lower, _strikes(settings, at, -at.rate_now)
    law = velocity_law(-_limit_slack(left, strikes) / substep.duration, at.mobility)
    return _constraint(
        at, law, ca.SX(0), None, settings.smoothing / at.mobility, left + TIE_DISTANCE * strikes, strikes
    )


@traced
def upper_limit(
    settings: StepSettings, joint: Joint, at: CoordinateTerms, command: Command, substep: SubstepTimes
) -> CoordinateConstraint:
    """Return the constraint of an upper limit."""
    left, strikes = joint.limits.upper - at.value, _strikes(settings, at, at.rate_now)
    law = velocity_law(_limit_slack(left, strikes) / substep.duration, at.mobility)
    return _constraint(
        at, law, None, ca.SX(0), settings.smoothing / at.mobility, left + TIE_DISTANCE * strikes, strikes
    )


def _limit_slack(left: Expr, strikes: Expr) -> Expr:
    """Return how far a limit may go within the substep; by rounding more at a strike, see ``TIE_DISTANCE``."""
    return ca.if_else(left < -TIE_DISTANCE, 0, left) + TIE_DISTANCE * strikes


def _strikes(settings: StepSettings, at: CoordinateTerms, closing: Expr) -> Expr:
    """Return 1 if a limit is reached at speed: faster than what acts in two steps brings about."""
    return closing > 4 * ca.fabs(at.rate - at.rate_now) + MIN_STRIKE_STEP / settings.scheme.dt


@traced
def spring_constraint(
    settings: StepSettings, joint: Joint, at: CoordinateTerms, command: Command, substep: SubstepTimes
) -> CoordinateConstraint:
    """Return the constraint of a spring and damper."""
    assert joint.spring is not None
    pull, half = _spring(settings, at, substep, joint.spring)
    return _constraint(at, affine_law(pull, half, at.mobility), None, None, ca.SX(0))


@traced
def friction_constraint(
    settings: StepSettings, joint: Joint, at: CoordinateTerms, command: Command, substep: SubstepTimes
) -> CoordinateConstraint:
    """Return the constraint of dry friction, which stops the coordinate with a bounded impulse."""
    most = joint.friction * substep.kick
    return _constraint(at, velocity_law(ca.SX(0), at.mobility), -most, most, settings.smoothing / at.mobility)


@traced
def coupling_constraint(
    coupling: JointCoupling, follows: CoordinateTerms, leads: CoordinateTerms | None, duration: Expr
) -> CoordinateConstraint:
    """Return the constraint of a coordinate that follows another of its tree; the position pass removes what is left.

    Its rate is seen with the slope at the middle of the substep, and its impulse acts with that at the start.
    """
    first = follows.of_tree
    assert first is not None
    if leads is None:
        jacobian, response = first.jacobian, first.response
        error = follows.value - coupling.polynomial[0]
    else:
        second, slope = leads.of_tree, coupling.slope(leads.value + duration / 2 * leads.rate_now)
        assert second is not None
        jacobian = first.jacobian - slope * second.jacobian
        response = first.response - coupling.slope(leads.value) * second.response
        error = follows.value - coupling.value(leads.value)
    both = TreeCoordinate(jacobian, response)
    at = replace(follows, mobility=ca.mtimes(jacobian, response), of_tree=both)
    return _constraint(at, velocity_law(ca.SX(0), at.mobility), None, None, ca.SX(0), error)


def _spring(settings: StepSettings, at: CoordinateTerms, substep: SubstepTimes, spring: Spring) -> tuple[Expr, Expr]:
    """Return a and b of the impulse -(a + b rate) of a spring and damper.

    The spring acts as if the coordinate were heavier by ``ADDED_MASS_SHARE`` k dt^2, whatever accelerates it: of second
    order, keeps energy, is stable at any k, and at rest its force is k (q - rest). The damper acts on the mean of the
    rates before and after: with all that acted in the step before, else what falls on it from then to this step would
    count twice, an error of first order.
    """
    heavier = ADDED_MASS_SHARE * spring.stiffness * settings.scheme.dt**2
    half = substep.kick * spring.damping / 2
    before = at.rate_now + (at.rate_due - at.rate_now) * (1 - 2 * substep.kick / substep.duration)
    pull = substep.kick * spring.stiffness * (at.value - spring.rest)
    return pull + (half - heavier) * before, half + heavier


CONSTRAINTS = {
    "motor": motor_constraint,
    "lower": lower_limit,
    "upper": upper_limit,
    "spring": spring_constraint,
    "friction": friction_constraint,
}
"""The constraint of each thing that acts along a coordinate."""


def _constraint(
    at: CoordinateTerms,
    law: dict[str, Expr],
    low: Expr | None,
    high: Expr | None,
    width: Expr,
    left: Expr | None = None,
    landing: Expr = NO_STRIKE,
    drive: Expr | None = None,
    jump: Expr | None = None,
) -> CoordinateConstraint:
    bounds = {"low": low, "high": high, "width": width, "left": left, "landing": landing, "drive": drive, "jump": jump}
    return CoordinateConstraint(
        at.terms,
        at.velocity_directions,
        at.impulse_directions,
        **law,
        **bounds,
        same=at.same,
        of_tree=at.of_tree,
        inverse_mobility=1 / at.mobility,
    )
