"""Two points, one on each body, that may become a point of contact, and the direction across it."""

from __future__ import annotations

import casadi as ca

from symphys.dynamics.collision.contact_geometry import Contact, Displacement, Frame
from symphys.dynamics.collision.predicted_path import Parabola
from symphys.dynamics.collision.time_of_impact import contact_along
from symphys.maths.smoothing import length
from symphys.records import dataclass
from symphys.types import Expr

HALF = 0.5
"""The share of a point of contact that lies midway; see ``Witness``."""


@dataclass(frozen=True)
class Witness:
    """Points that two bodies carry, and a direction that turns with them.

    Attributes:
        points: paths of the two points [m], world frame.
        arms: of the two points, from their bodies' centres of mass.
        normal: path of a vector from the second surface to the first, of any length.
        radii: of balls about the points [m].
        off: 1 where the points are no candidates for contact.
        far: the gap [m] that such points are said to have.
        end: of the step [s].
        share: where the point of contact lies between them: 1 at the first, as of a corner on a face, 0 at the second.
    """

    points: tuple[Parabola, Parabola]
    arms: tuple[Parabola, Parabola]
    normal: Parabola
    radii: tuple[Expr, Expr]
    off: Expr
    far: Expr
    end: Expr
    share: Expr | float = HALF

    def gap(self, t: Expr) -> Expr:
        """Return the gap [m] at time t in the step."""
        return ca.dot(self._direction(t), (self.points[0] - self.points[1]).at(t)) - self.radii[0] - self.radii[1]

    def frame(self, t: Expr) -> Frame:
        """Implement ``ContactGeometry.frame``; both arms end midway between the surfaces, which adds no spin."""
        n, (a, b), (r_a, r_b) = self._direction(t), self.points, self.radii
        half = ((a - b).at(t) - (r_a + r_b) * n) / 2
        first, second = self.arms[0].at(t) - r_a * n - half, self.arms[1].at(t) + r_b * n + half
        if self.share is HALF:
            return Frame(n, (first, second))
        beside = (2 * self.share - 1) * half
        return Frame(n, (first + beside, second + beside))

    def gap_after(self, first: Displacement, second: Displacement) -> Expr:
        """Implement ``ContactGeometry.gap_after``."""
        (a, b), (arm_a, arm_b) = self.points, self.arms
        apart = first.moved(a.start, arm_a.start) - second.moved(b.start, arm_b.start)
        gap = ca.dot(self._direction(self.end), apart) - self.radii[0] - self.radii[1]
        return ca.if_else(self.off, self.far, gap)

    def _direction(self, t: Expr) -> Expr:
        n = self.normal.at(t)
        return n / length(n)


def steady(normal: Parabola, t: Expr, dt: Expr) -> Parabola:
    """Return the path of a vector; one that changes by more than half of its length at ``t`` stays as it is then.

    The common perpendicular of edges that are nearly parallel may turn right round within a step, or vanish.
    """
    now, change = normal.at(t), normal.at(dt) - normal.start
    keep = 4 * ca.dot(change, change) < ca.dot(now, now)
    return Parabola(ca.if_else(keep, normal.start, now), keep * normal.velocity, keep * normal.acceleration)


def contact_of(witness: Witness) -> Contact:
    """Return the contact of a witness; none within the step where it is off."""
    met, off = contact_along(witness, witness.end), witness.off
    return Contact(
        gap=ca.if_else(off, witness.far, met.gap),
        rate=ca.if_else(off, 0, met.rate),
        hit=ca.logic_and(met.hit, ca.logic_not(off)),
        time=ca.if_else(off, witness.end, met.time),
        end=ca.if_else(off, witness.far, met.end),
        geometry=witness,
    )
