"""The law of friction of a contact: which impulses across its normal a load admits, and which of them it gives.

A load l, the normal impulse, admits a convex set of friction impulses, which grows in proportion to l. A projection
gives the impulse of the set that is nearest to the one that would stop the slip. What converges then is the impulse
that takes most power from the slip: the principle of maximal dissipation (Moreau, 1974).

With one coefficient the set is a disc, with two, along and across a direction, an ellipse. All that the step knows of
friction is here: constraints, Newton's method before the sweeps, the local solver of strongly coupled contacts and late
impulses of soft ones ask a ``Friction``. Its coefficients, and how those of two surfaces make one, are fields of
``Law``.
"""

from __future__ import annotations

from collections.abc import Callable
from math import hypot
from typing import Protocol

import casadi as ca

from symphys.dynamics.contact.body_term import Motions
from symphys.maths.smoothing import TINY_SQUARE, TINY_WIDTH_SQUARE, length, onto_disc, positive
from symphys.model.world import Law
from symphys.records import dataclass
from symphys.types import Expr

MIN_DIRECTION_ANGLE = 0.05
"""[rad] from the normal of a contact, within which a direction of friction fades out."""
TINY_LEAN = 1e-8
"""Added to the square of a direction's part across the normal, so that its slope is finite where there is none."""
ELLIPSE_NEWTON_STEPS = 5
"""Newton steps towards the nearest impulse of an ellipse. That is then off by 1e-14 of its size at most for
coefficients in a ratio of up to 10, by 1e-9 for 100 and by 3e-8 for 10,000."""
TINY_LOAD = 1e-24
"""[N s] added to loads that divide."""

Slope = Callable[[Expr, Expr], Expr]
"""The slope of ``positive`` of an impulse [N s] over a width [N s]."""


@dataclass(frozen=True)
class FrictionStep:
    """A contact at which Newton's method linearises the projection of friction.

    Attributes:
        normal: (3,) unit vector.
        old: (3,) friction impulse so far [N s].
        wanted: (3,) friction impulse that would stop the slip [N s].
        load: normal impulse [N s].
        mass: effective mass across the normal [kg].
        smoothing: s [m/s].
        softness: compliance that Newton's method gives rigid contacts, times ``mass``.
        centre: 1 if what is given at that softness counts from 0, 0 if from ``old``.
        slope: of the bound.
    """

    normal: Expr
    old: Expr
    wanted: Expr
    load: Expr
    mass: Expr
    smoothing: Expr
    softness: Expr
    centre: Expr
    slope: Slope


class Friction(Protocol):
    """The law of friction at one contact. Implementations are frozen dataclasses.

    On the edge of its cone a contact with load l and heading d, a unit vector (3,) across the normal, gives the impulse
    l ``largest`` ``shaped(d)``, which takes most power from a slip v whose ``shaped(v)`` is opposite to d.
    """

    @property
    def largest(self) -> Expr:
        """Return the largest friction impulse per unit of load."""
        ...

    def shaped(self, vector: Expr) -> Expr:
        """Return a vector across the normal (3,), shortened where friction is less than the largest."""
        ...

    def heading(self, wanted: Expr, load: Expr) -> Expr:
        """Return the unit vector (3,) along the impulse on the edge that is nearest to ``wanted`` (3,) [N s]."""
        ...

    def nearest(self, wanted: Expr, load: Expr, width: Expr, smoothing: Expr) -> Expr:
        """Return the admissible impulse (3,) [N s] nearest to ``wanted`` (3,), across the normal.

        Args:
            wanted: friction impulse that would stop the slip [N s].
            load: normal impulse [N s].
            width: over which the smoothed law bends [N s].
            smoothing: s [m/s]; 0 is the exact law.
        """
        ...

    def against(self, slip: Expr) -> Expr:
        """Return the friction impulse (3,) per unit of load against a ``slip`` (3,) across the normal [m/s]."""
        ...

    def admits(self, impulse: Expr, load: Expr) -> Expr:
        """Return 1 if the law admits a friction impulse (3,) [N s] across the normal at this load [N s], else 0."""
        ...

    def beyond(self, impulse: Expr, load: Expr, share: float) -> Expr:
        """Return 1 if a friction impulse (3,) [N s] exceeds this share of the largest in its direction."""
        ...

    def linearised(self, at: FrictionStep) -> tuple[Expr, Expr, Expr]:
        """Return a (3,), g (3,), B (3, 3): friction changes by a + g dl - B dv with the load l and the slip v."""
        ...


def friction_at(law: Law, normal: Expr, motions: Motions, t: Expr) -> Friction:
    """Return the law of friction at a contact.

    Args:
        law: of the contact.
        normal: (3,) unit vector, world frame.
        motions: of the contact's bodies, with which directions that are fixed in a body turn.
        t: instant within the step [s].
    """
    if law.friction_direction is None or not isinstance(law.friction, tuple):
        return Disc(law.friction)
    size = hypot(*law.friction_direction)
    unit = [number / size for number in law.friction_direction]
    direction = ca.SX(unit) if law.friction_side is None else motions[law.friction_side].arm(unit).at(t)
    leaning = direction - normal * ca.dot(normal, direction)
    square = ca.dot(leaning, leaning)
    along, across = law.friction
    # a direction that is nearly normal to the contact says nothing: friction is that across it
    counts = ca.fmin(square / MIN_DIRECTION_ANGLE**2, 1)
    return Ellipse(across + (along - across) * counts, ca.SX(across), leaning / ca.sqrt(square + TINY_LEAN**2))


@dataclass(frozen=True)
class Disc:
    """Coulomb's law with one coefficient mu: |friction impulse| <= mu load. The same of torques, with a radius [m].

    Attributes:
        coefficient: mu.
    """

    coefficient: Expr

    @property
    def largest(self) -> Expr:
        """Implement ``Friction.largest``."""
        return self.coefficient

    def shaped(self, vector: Expr) -> Expr:
        """Implement ``Friction.shaped``."""
        return vector

    def heading(self, wanted: Expr, load: Expr) -> Expr:
        """Implement ``Friction.heading``."""
        del load
        return wanted / length(wanted)

    def nearest(self, wanted: Expr, load: Expr, width: Expr, smoothing: Expr) -> Expr:
        """Implement ``Friction.nearest``."""
        return onto_disc(wanted, self.coefficient * load, width, smoothing)

    def against(self, slip: Expr) -> Expr:
        """Implement ``Friction.against``."""
        return self.coefficient * slip / length(slip)

    def admits(self, impulse: Expr, load: Expr) -> Expr:
        """Implement ``Friction.admits``."""
        return ca.dot(impulse, impulse) <= (self.coefficient * load) ** 2

    def beyond(self, impulse: Expr, load: Expr, share: float) -> Expr:
        """Implement ``Friction.beyond``."""
        return ca.sqrt(ca.dot(impulse, impulse) + TINY_SQUARE) > share * (self.coefficient * load)

    def linearised(self, at: FrictionStep) -> tuple[Expr, Expr, Expr]:
        """Implement ``Friction.linearised``: along ``wanted`` it is stretched or cut, across it turned."""
        wanted, gives = at.wanted, at.softness
        radius, size, width = self.coefficient * at.load, length(wanted), at.mass * at.smoothing
        smooth = at.smoothing > 0
        reach = ca.if_else(smooth, radius + positive(size - radius, width) + 1e-30, ca.fmax(size, radius))
        falls = at.slope(size - radius, width)
        share, along = radius / reach, wanted / size
        stretch = share * (1 - size * falls / reach)
        grows = self.coefficient * size / reach * (1 - radius * (1 - falls) / reach)
        counted = gives * at.centre
        change = share * wanted - at.old
        ahead = along * ca.dot(along, change - counted * stretch * at.old) / (1 - stretch + gives)
        beside = change - counted * share * at.old
        beside = (beside - along * ca.dot(along, beside)) / (1 - share + gives)
        line = ca.mtimes(along, along.T)
        plane = ca.SX.eye(3) - ca.mtimes(at.normal, at.normal.T) - line
        sliding = at.mass * (stretch / (1 - stretch + gives) * line + share / (1 - share + gives) * plane)
        return ahead + beside, grows / (1 - stretch + gives) * along, sliding


@dataclass(frozen=True)
class Ellipse:
    """Coulomb's law with two coefficients: (f1 / mu1)^2 + (f2 / mu2)^2 <= load^2 of friction impulses f.

    A slip v meets -load M^2 v / |M v|, M the diagonal matrix of the coefficients: the impulse that takes most power
    from it, which is not opposite to it. With mu1 = mu2 it is that of ``Disc``.

    The impulse x of the ellipse that is nearest to y outside has x_i = b_i y_i / (b_i + T) with b_i = mu_i^2 load and
    T > 0 the root of |s| = 1, s_i = mu_i y_i / (b_i + T): then y - x = T M^-2 x / load is normal to the ellipse.
    1 / |s| is concave in T and nearly linear (as in More and Sorensen, Computing a trust region step, SIAM J. Sci.
    Stat. Comput. 4, 1983); for a disc it is linear. So Newton's method converges fast from a guess of the right size.

    The smoothed law has positive(T, width (mu1 + mu2) / 2) in place of T, which is that of ``Disc`` if mu1 = mu2.

    Attributes:
        along, across: mu1, mu2.
        direction: (3,) unit vector across the normal, for which mu1 holds; 0 where it does not matter.
    """

    along: Expr
    across: Expr
    direction: Expr

    @property
    def largest(self) -> Expr:
        """Implement ``Friction.largest``."""
        return ca.fmax(self.along, self.across)

    def shaped(self, vector: Expr) -> Expr:
        """Implement ``Friction.shaped``."""
        largest = self.largest + TINY_LOAD
        return self._times(vector, self.along / largest, self.across / largest)

    def heading(self, wanted: Expr, load: Expr) -> Expr:
        """Implement ``Friction.heading``."""
        outside, root = self._root(wanted, load)
        p, q = self._sums(load, ca.if_else(outside, root, 0))
        scaled = self._times(wanted, self.along * q, self.across * p)
        return scaled / ca.sqrt(ca.dot(scaled, scaled) + TINY_WIDTH_SQUARE)

    def nearest(self, wanted: Expr, load: Expr, width: Expr, smoothing: Expr) -> Expr:
        """Implement ``Friction.nearest``."""
        smooth, (outside, root) = smoothing > 0, self._root(wanted, load)
        within = ca.if_else(outside, root, self._inside(wanted, load))
        p, q = self._sums(load, ca.if_else(smooth, positive(within, width * self._mean), ca.if_else(outside, root, 0)))
        c1, c2 = self._scaled(wanted)
        # x = mu_i^2 load y_i / (b_i + T), shortened to |s| = 1, from which rounding and Newton's method may be off
        size = ca.sqrt((c1 * q) ** 2 + (c2 * p) ** 2 + TINY_WIDTH_SQUARE)
        whole = ca.if_else(smooth, p * q, ca.fmax(size, p * q))
        return self._times(wanted, self.along**2 * load * q / whole, self.across**2 * load * p / whole)

    def against(self, slip: Expr) -> Expr:
        """Implement ``Friction.against``."""
        scaled = self._times(slip, self.along, self.across)
        return self._times(scaled, self.along, self.across) / length(scaled)

    def admits(self, impulse: Expr, load: Expr) -> Expr:
        """Implement ``Friction.admits``."""
        first, rest = self._split(impulse)
        within = ca.logic_and(first**2 <= (self.along * load) ** 2, ca.dot(rest, rest) <= (self.across * load) ** 2)
        return ca.logic_and(within, self._gauge(impulse) <= load**2)

    def beyond(self, impulse: Expr, load: Expr, share: float) -> Expr:
        """Implement ``Friction.beyond``."""
        return ca.sqrt(self._gauge(impulse) + TINY_SQUARE) > share * load

    def linearised(self, at: FrictionStep) -> tuple[Expr, Expr, Expr]:
        """Implement ``Friction.linearised``.

        Along the axes, with b, s, T of ``Ellipse``, r = mu_i s_i / (b_i + T) and Q = sum s_i^2 / (b_i + T) at the edge:
        dT / dy = r / Q, dT / dload = -sum mu_i r_i s_i / Q, dx / dy = diag(b_i / (b_i + T)) - load r (dT / dy)^T.
        """
        basis, mu = ca.horzcat(self.direction, ca.cross(at.normal, self.direction)), ca.vertcat(self.along, self.across)
        y, old, squares = ca.mtimes(basis.T, at.wanted), ca.mtimes(basis.T, at.old), mu * mu
        smooth, (outside, root), width = at.smoothing > 0, self._root(at.wanted, at.load), at.mass * at.smoothing
        root = ca.if_else(outside, root, self._inside(at.wanted, at.load))
        t = ca.if_else(smooth, positive(root, width * self._mean), ca.fmax(root, 0))
        falls = at.slope(root / (self._mean + TINY_LOAD), width)

        # slopes of T: those of the root, times that of the bound
        share: Expr = ca.vertcat(*(1 / each for each in self._sums(at.load, ca.fmax(root, 0))))
        s = mu * share * y
        s = s / length(s)
        by_wanted = falls * mu * share * s / (ca.dot(s, s * share) + TINY_LOAD)
        by_load = -ca.dot(mu * s, by_wanted)

        # slopes of x
        share = ca.vertcat(*(1 / each for each in self._sums(at.load, t)))
        by_t = squares * at.load * share * share * y
        slope = ca.diag(squares * at.load * share) - ca.mtimes(by_t, by_wanted.T)
        widens = squares * share * share * t * y - by_t * by_load

        # what the projection answers, since a change of the impulse is wanted again
        change = squares * at.load * share * y - old
        answer = ca.inv_minor((1 + at.softness) * ca.SX.eye(2) - slope)
        counted = at.softness * at.centre * ca.mtimes(slope, old)
        sliding = at.mass * ca.mtimes(answer, slope)
        first, grows = (ca.mtimes(basis, ca.mtimes(answer, each)) for each in (change - counted, widens))
        return first, grows, ca.mtimes(ca.mtimes(basis, sliding), basis.T)

    @property
    def _mean(self) -> Expr:
        return (self.along + self.across) / 2

    def _split(self, vector: Expr) -> tuple[Expr, Expr]:
        """Return the component along the direction, and the rest (3,), of a vector across the normal."""
        first = ca.dot(self.direction, vector)
        return first, vector - self.direction * first

    def _times(self, vector: Expr, one: Expr, two: Expr) -> Expr:
        """Return the part of a vector along the direction times ``one`` (3,), and the rest times ``two``."""
        first, rest = self._split(vector)
        return self.direction * (one * first) + two * rest

    def _scaled(self, wanted: Expr) -> tuple[Expr, Expr]:
        """Return mu_i |y_i|."""
        first, rest = self._split(wanted)
        return self.along * ca.fabs(first), self.across * length(rest)

    def _sums(self, load: Expr, t: Expr) -> tuple[Expr, Expr]:
        """Return b_i + T."""
        return self.along**2 * load + t + TINY_LOAD, self.across**2 * load + t + TINY_LOAD

    def _gauge(self, impulse: Expr) -> Expr:
        """Return the square of the least load that admits an impulse; a direction without friction does not count."""
        first, rest = self._split(impulse)
        one, two = (mu / (mu**2 + TINY_LOAD) for mu in (self.along, self.across))
        return (first * one) ** 2 + ca.dot(rest, rest) * two**2

    def _inside(self, wanted: Expr, load: Expr) -> Expr:
        """Return T < 0 inside the ellipse, by the distance from the edge.

        There T is 0, with the slope of that outside.
        """
        (c1, c2), (b1, b2) = self._scaled(wanted), self._sums(load, ca.SX(0))
        square = (c1 / b1) ** 2 + (c2 / b2) ** 2
        middle = self._mean**2 * load + TINY_LOAD
        fall = (c1 / b1) ** 2 / b1 + (c2 / b2) ** 2 / b2 + ca.fmax(1 - square, 0) / middle
        return (ca.sqrt(square + TINY_SQUARE) - 1) / fall

    def _root(self, wanted: Expr, load: Expr) -> tuple[Expr, Expr]:
        """Return 1 if an impulse lies outside the ellipse, and T of the nearest one on the edge."""
        (c1, c2), (b1, b2) = self._scaled(wanted), self._sums(load, ca.SX(0))
        outside = (c1 * b2) ** 2 + (c2 * b1) ** 2 > (b1 * b2) ** 2

        # a lower bound, and a guess: what lies across the long axis falls off first
        wide, longer, shorter = b1 > b2, ca.fmax(b1, b2), ca.fmin(b1, b2)
        ahead, beside = ca.if_else(wide, c1, c2), ca.if_else(wide, c2, c1)
        low = ca.fmax(ca.fmax(ca.fmax(c1 - b1, c2 - b2), ca.sqrt(c1**2 + c2**2 + TINY_SQUARE) - longer), 0)
        missing = ca.fmax(1 - (ahead / longer) ** 2, 0) + ca.sqrt(beside / ca.fmax(ahead, longer) + TINY_LOAD)
        t = ca.fmax(low, beside / ca.sqrt(missing) - shorter)

        # Newton's method for 1 / |s| = 1, with |s| p q
        for _ in range(ELLIPSE_NEWTON_STEPS):
            p, q = b1 + t, b2 + t
            one, two = (c1 * q) ** 2, (c2 * p) ** 2
            size = ca.sqrt(one + two + TINY_WIDTH_SQUARE)
            t = ca.fmax(t + size**2 * (size - p * q) / (one * q + two * p + TINY_WIDTH_SQUARE), low)
        return outside, t
