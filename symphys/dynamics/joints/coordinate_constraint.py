"""The constraint of one thing that acts along a coordinate of a joint: a motor, a limit, a spring.

A sweep gives  impulse <- clip(keep impulse - slope rate - offset, low, high).  A velocity that is asked for with
impulse bounds: keep 1, slope m, offset -m target, with m the effective mass. A law a + b rate of the force, solved for
the rate after it: keep b K/(1 + b K), slope b/(1 + b K), offset a/(1 + b K), with K = 1/m.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca

from symphys.dynamics.contact.body_term import BodyTerm
from symphys.dynamics.joints.joint_impulse import NO_DIRECTIONS, Directions, JointImpulse, apply_impulse, speeds
from symphys.dynamics.tracing.decorator import traced
from symphys.dynamics.unknowns import COMPLIANCE, GeneralizedVelocities, Linearisation
from symphys.maths.smoothing import at_least, at_most, positive_slope
from symphys.records import dataclass
from symphys.types import Expr


@dataclass(frozen=True)
class TreeCoordinate:
    """A coordinate of a tree: its Jacobian (1, n), and the response (n,) of the velocities to a unit impulse."""

    jacobian: Expr
    response: Expr


@dataclass(frozen=True)
class CoordinateConstraint:
    """A constraint along one coordinate, prepared for the sweeps; impulses in [N m s], or [N s] where it slides.

    Attributes:
        terms: arms at the constraint's instant, and to the common point for impulses.
        velocity_directions, impulse_directions: the one direction at the constraint's instant, and of the impulse.
        keep, slope, offset: see the module.
        low, high: bounds of the impulse; None where there is none.
        width: of the smoothed bounds [N m s].
        same: whether both bodies are of one tree of joints.
        of_tree: where the coordinate is one of a tree's.
        left: how far a limit is away at the start, or a coupling is off [rad], [m]; None for what is neither.
        inverse_mobility: effective mass.
        landing: 1 for a limit that is struck: its impulse is an impact, not a force.
        drive: what a motor's command gives by itself [N m], [N]; None for what aims at a velocity.
        jump: by how much that differs from the step before; None for a motor that gives nothing else.
        pushed: how much less impulse it gives for a unit impulse of the constraint before it, see
            ``project_sequentially``.
    """

    terms: tuple[BodyTerm, ...]
    velocity_directions: Directions
    impulse_directions: Directions
    keep: Expr
    slope: Expr
    offset: Expr
    low: Expr | None
    high: Expr | None
    width: Expr
    same: bool
    of_tree: TreeCoordinate | None
    left: Expr | None
    inverse_mobility: Expr
    landing: Expr
    drive: Expr | None = None
    jump: Expr | None = None
    pushed: Expr | None = None

    def position_impulse(self, moved: Expr) -> Expr:
        """Return the impulse times a time (1,) that takes a limit, or a coupling, back to where it holds.

        See ``LockConstraint``.
        """
        if self.low is None and self.high is None:
            return -self.inverse_mobility * (self.left + moved)
        sign = 1 if self.low is not None else -1
        beyond = self.left + sign * moved
        return -sign * self.inverse_mobility * ca.fmin(beyond, 0)

    def rate(self, momenta: tuple[Any, ...]) -> Expr:
        """Return the rate of the coordinate [rad/s] or [m/s]."""
        if self.of_tree is None:
            return speeds(self.terms, self.velocity_directions, momenta)
        return momenta[0].along(self.of_tree.jacobian)

    def stored_form(self, impulse: JointImpulse) -> Expr:
        """Return the stored form (1,) of an impulse or of a force."""
        return impulse.numbers

    def from_stored(self, stored: Expr) -> JointImpulse:
        """Return the impulse that has this stored form."""
        return JointImpulse(stored)

    def project(self, momenta: tuple[Any, ...], old: JointImpulse) -> tuple[tuple[Any, ...], JointImpulse]:
        """Implement ``VelocityConstraint.project``."""
        new, change = self.answer(self.rate(momenta), old.numbers)
        return self.apply(momenta, JointImpulse(change)), JointImpulse(new)

    rates = seen = rate

    def alone(self) -> CoordinateConstraint:
        """Implement ``VelocityConstraint.alone``."""
        zero, law = (
            ca.SX(0),
            replace(self, terms=(), velocity_directions=NO_DIRECTIONS, impulse_directions=NO_DIRECTIONS),
        )
        return replace(law, of_tree=None, left=None, inverse_mobility=zero, landing=zero, drive=None, jump=None)

    def response(self, seen: Expr, old: JointImpulse) -> JointImpulse:
        """Implement ``ImpulseLaw.response``."""
        return JointImpulse(self.answer(seen, old.numbers)[0])

    def linearised(self, seen: Expr, old: JointImpulse, by: Linearisation) -> tuple[Expr, Expr]:
        """Implement ``ImpulseLaw.linearised``: a (1,) and B (1, 1)."""
        wanted = self.keep * old.numbers - self.offset - self.slope * seen
        new, follows = self.bounded(wanted), self._follows(wanted, by)
        gives = 1 - follows * self.keep + COMPLIANCE
        return (
            new - old.numbers - COMPLIANCE * by.centre * follows * old.numbers
        ) / gives, follows * self.slope / gives

    def _follows(self, impulse: Expr, by: Linearisation) -> Expr:
        """Return the slope of ``bounded``."""
        slope = ca.SX(1)
        if self.low is not None:
            slope *= self._inside(impulse - self.low, by)
            impulse = at_least(impulse, self.low, self.width)
        if self.high is not None:
            slope *= self._inside(self.high - impulse, by)
        return slope

    def _inside(self, distance: Expr, by: Linearisation) -> Expr:
        smooth = positive_slope(distance, self.width)
        return ca.if_else(self.width > 0, smooth, by.within(distance, self.slope))

    def answer(self, rate: Expr, old: Expr, less: Expr | None = None) -> tuple[Expr, Expr]:
        """Return the impulse after a projection, and its change; ``less`` is known last, so it is taken off last."""
        free = self.low is None and self.high is None
        new = self.keep * old - self.offset - (old if free else 0) - self.slope * rate
        new = new if less is None else new - less
        if free:
            return old + new, new
        new = self.bounded(new)
        return new, new - old

    def bounded(self, impulse: Expr) -> Expr:
        """Clamp an impulse to the bounds."""
        if self.low is not None:
            impulse = at_least(impulse, self.low, self.width)
        if self.high is not None:
            impulse = at_most(impulse, self.high, self.width)
        return impulse

    def apply(self, momenta: tuple[Any, ...], impulse: JointImpulse) -> tuple[Any, ...]:
        """Implement ``VelocityConstraint.apply``."""
        if self.of_tree is None:
            return apply_impulse(self.terms, self.impulse_directions, momenta, impulse.numbers, self.same)
        after = GeneralizedVelocities(momenta[0].numbers + ca.mtimes(self.of_tree.response, impulse.numbers))
        return tuple(after for _ in self.terms)


def project_sequentially(
    constraints: Sequence[CoordinateConstraint], velocities: GeneralizedVelocities, old: Sequence[JointImpulse]
) -> tuple[GeneralizedVelocities, list[JointImpulse]]:
    """Project coordinates of one tree, one after the other.

    Each takes the rate from the velocities before the last change, and what that did to it from ``pushed``. So two
    projections are under way at a time: a processor that waits for results does not wait for one after the other.
    """
    before, given = velocities, list[JointImpulse]()
    change: Expr = None
    for constraint, impulse in zip(constraints, old, strict=True):
        less: Expr = None if change is None else constraint.pushed * change
        new, change = constraint.answer(constraint.rate((before,)), impulse.numbers, less)
        before = velocities
        (velocities, *_) = constraint.apply((velocities,), JointImpulse(change))
        given.append(JointImpulse(new))
    return velocities, given


@traced
def coupling_to_previous(first: CoordinateConstraint, then: CoordinateConstraint) -> Expr:
    """Return ``CoordinateConstraint.pushed`` (1,) of the second constraint."""
    assert first.of_tree is not None and then.of_tree is not None
    return then.slope * GeneralizedVelocities(first.of_tree.response).along(then.of_tree.jacobian)


def velocity_law(target: Expr, mobility: Expr) -> dict[str, Expr]:
    """Return the coefficients of a constraint that asks for a velocity."""
    return {"keep": ca.SX(1), "slope": 1 / mobility, "offset": -target / mobility}


def affine_law(a: Expr, b: Expr, mobility: Expr) -> dict[str, Expr]:
    """Return the coefficients of a constraint whose impulse is -(a + b rate)."""
    share = 1 / (1 + b * mobility)
    return {"keep": b * mobility * share, "slope": b * share, "offset": a * share}
