"""What stays the same over a step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca

from symphys.dynamics.tracing.decorator import traced
from symphys.maths.smoothing import TINY_SQUARE
from symphys.model.state_layout import input_columns
from symphys.model.world import Pair, Scheme, World
from symphys.types import Expr

MIN_KICK_SHARE = 1 / 8
"""Of dt; see ``StepContext.shortest_kick``."""
MAX_REST_GAP = 0.1
"""Of the distance a_ref dt^2: surfaces that carried load and are that near to each other go on touching."""
MIN_REFERENCE_ACCELERATION = 1.0
"""[m/s^2] least reference acceleration: what counts as fast when there is no gravity."""


State = dict[str, Expr]
"""The state's parts by name; see ``symphys.model.state_layout.Layout``."""


@dataclass(frozen=True)
class StepSettings:
    """Settings that every part of a step may use.

    Attributes:
        scheme: how the step is taken.
        gravity: (3,) [m/s^2].
        smoothing: s [m/s], see docs/time_step.md.
        reference: the acceleration [m/s^2] below which nothing counts as fast.
    """

    scheme: Scheme
    gravity: Expr
    smoothing: Expr
    reference: Expr

    @property
    def fast(self) -> Expr:
        """The speed [m/s] of approach above which a contact is an impact, not rest."""
        return 2 * self.reference * self.scheme.dt


@dataclass(frozen=True)
class StepContext:
    """What stays the same over a step.

    Attributes:
        world: what is simulated.
        settings: how.
        inputs: names of the forces and torques that ``u`` stacks.
        u: what the inputs stack, constant over the step.
        near: per pair: 1 if it may act in the step, 0 if it is too far apart; empty: all may.
    """

    world: World
    settings: StepSettings
    inputs: tuple[str, ...]
    u: Expr
    near: tuple[Expr, ...] = ()

    def pairs_and_near(self) -> Iterator[tuple[Pair, Expr]]:
        """The pairs, and whether they may act."""
        return zip(self.world.pairs, self.near or [ca.SX(1)] * len(self.world.pairs), strict=True)

    def input(self, name: str) -> Expr | None:
        """The input of this name; None if there is none."""
        columns = input_columns(self.world, self.inputs).get(name)
        return None if columns is None else self.u[columns]

    @property
    def shortest_kick(self) -> Expr:
        """[s]: impulses of a shorter substep are stored as forces over this time; what an impact adds is no force."""
        return MIN_KICK_SHARE * self.settings.scheme.dt


def make_context(world: World, scheme: Scheme | None, inputs: tuple[str, ...], u: Expr, smoothing: Expr) -> StepContext:
    """The context of a world."""
    gravity = ca.vertcat(*world.gravity)
    settings = StepSettings(scheme or Scheme(), gravity, smoothing, reference(gravity))
    return StepContext(world, settings, inputs, u)


@traced
def reference(gravity: Expr) -> Expr:
    """|gravity|, or 1 m/s^2 if that is more."""
    return ca.fmax(ca.sqrt(ca.dot(gravity, gravity) + TINY_SQUARE), MIN_REFERENCE_ACCELERATION)
