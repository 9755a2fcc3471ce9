"""What stays the same over a step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.smooth import TINY_SQUARE
from symphys.state import Layout
from symphys.step.record import Keep, Repeat, over_again, whole
from symphys.world import Scheme, World

Expr = Any
"""casadi SX, MX or DM"""

SLOWEST = 1.0
"""[m/s^2] least reference acceleration: what counts as fast when there is no gravity."""


@dataclass(frozen=True)
class Scene:
    """What stays the same over a step.

    Attributes:
        world, scheme, layout: what is simulated and how.
        inputs: names of the forces and torques that ``u`` stacks.
        u: (3 * inputs,), constant over the step.
        knob: smoothing [m/s].
        keep, repeat: see ``record``: ``whole`` and ``over_again``, or those of a ``Recorder``.
    """

    world: World
    scheme: Scheme
    layout: Layout
    inputs: tuple[str, ...]
    u: Expr
    knob: Expr
    keep: Keep = whole
    repeat: Repeat = over_again

    @property
    def gravity(self) -> Expr:
        """(3,) [m/s^2]."""
        return ca.vertcat(*self.world.gravity)

    @property
    def reference(self) -> Expr:
        """The acceleration [m/s^2] below which nothing counts as fast."""
        return ca.fmax(ca.sqrt(ca.dot(self.gravity, self.gravity) + TINY_SQUARE), SLOWEST)

    @property
    def fast(self) -> Expr:
        """The speed [m/s] of approach above which a contact is an impact, not rest."""
        return 2 * self.reference * self.scheme.dt
