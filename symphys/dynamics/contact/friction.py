"""The law of friction of a contact: which impulses across its normal a load admits, and which of them it gives.

A load l, the normal impulse, admits a convex set of friction impulses, which grows in proportion to l. A projection
gives the impulse of the set that is nearest to the one that would stop the slip. What converges then is the impulse
that takes most power from the slip: the principle of maximal dissipation (Moreau, 1974).

All that the step knows of friction is here: constraints, Newton's method before the sweeps, the local solver of
strongly coupled contacts and late impulses of soft ones ask a ``Friction``. Its coefficients, and how those of two
surfaces make one, are fields of ``Law``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import casadi as ca

from symphys.dynamics.contact.body_term import Motions
from symphys.maths.smoothing import TINY_SQUARE, length, onto_disc, positive
from symphys.model.world import Law
from symphys.types import Expr

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
    centre: float
    slope: Slope


class Friction(Protocol):
    """The law of friction at one contact. Implementations are frozen dataclasses.

    On the edge of its cone a contact with load l and heading d, a unit vector (3,) across the normal, gives the impulse
    l ``largest`` ``shaped(d)``, which takes most power from a slip v whose ``shaped(v)`` is opposite to d.
    """

    @property
    def largest(self) -> Expr:
        """The largest friction impulse per unit of load."""
        ...

    def shaped(self, vector: Expr) -> Expr:
        """(3,): a vector across the normal, shortened where friction is less than the largest."""
        ...

    def heading(self, wanted: Expr, load: Expr) -> Expr:
        """(3,) unit vector: heading of the impulse on the edge that is nearest to ``wanted`` (3,) [N s]."""
        ...

    def nearest(self, wanted: Expr, load: Expr, width: Expr, smoothing: Expr) -> Expr:
        """(3,) [N s]: the admissible impulse nearest to ``wanted`` (3,), across the normal.

        Args:
            wanted: friction impulse that would stop the slip [N s].
            load: normal impulse [N s].
            width: over which the smoothed law bends [N s].
            smoothing: s [m/s]; 0 is the exact law.
        """
        ...

    def against(self, slip: Expr) -> Expr:
        """(3,): friction impulse per unit of load against a ``slip`` (3,) across the normal [m/s]."""
        ...

    def admits(self, impulse: Expr, load: Expr) -> Expr:
        """1 if the law admits a friction impulse (3,) [N s] across the normal at this load [N s], else 0."""
        ...

    def beyond(self, impulse: Expr, load: Expr, share: float) -> Expr:
        """1 if a friction impulse (3,) [N s] is more than this share of what its load admits in its direction."""
        ...

    def linearised(self, at: FrictionStep) -> tuple[Expr, Expr, Expr]:
        """(a (3,), g (3,), B (3, 3)): friction changes by a + g dl - B dv with the load l and the slip v."""
        ...


def friction_at(law: Law, normal: Expr, motions: Motions, t: Expr) -> Friction:
    """The law of friction at a contact.

    Args:
        law: of the contact.
        normal: (3,) unit vector, world frame.
        motions: of the contact's bodies, with which directions that are fixed in a body turn.
        t: instant within the step [s].
    """
    del normal, motions, t  # friction is the same in all directions
    return Disc(law.friction)


@dataclass(frozen=True)
class Disc:
    """Coulomb's law with one coefficient mu: |friction impulse| <= mu load. The same of torques, with a radius [m].

    Attributes:
        coefficient: mu.
    """

    coefficient: Expr

    @property
    def largest(self) -> Expr:
        """See ``Friction``."""
        return self.coefficient

    def shaped(self, vector: Expr) -> Expr:
        """See ``Friction``."""
        return vector

    def heading(self, wanted: Expr, load: Expr) -> Expr:
        """See ``Friction``."""
        del load
        return wanted / length(wanted)

    def nearest(self, wanted: Expr, load: Expr, width: Expr, smoothing: Expr) -> Expr:
        """See ``Friction``."""
        return onto_disc(wanted, self.coefficient * load, width, smoothing)

    def against(self, slip: Expr) -> Expr:
        """See ``Friction``."""
        return self.coefficient * slip / length(slip)

    def admits(self, impulse: Expr, load: Expr) -> Expr:
        """See ``Friction``."""
        return ca.dot(impulse, impulse) <= (self.coefficient * load) ** 2

    def beyond(self, impulse: Expr, load: Expr, share: float) -> Expr:
        """See ``Friction``."""
        return ca.sqrt(ca.dot(impulse, impulse) + TINY_SQUARE) > share * (self.coefficient * load)

    def linearised(self, at: FrictionStep) -> tuple[Expr, Expr, Expr]:
        """See ``Friction``. What points along ``wanted`` is stretched or cut, what lies across it is turned."""
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
