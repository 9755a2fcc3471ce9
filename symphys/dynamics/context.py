"""Settings, world and inputs that are constant over a step."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca

from symphys.dynamics.tracing.decorator import traced
from symphys.maths.smoothing import TINY_SQUARE
from symphys.model.state_layout import input_columns
from symphys.model.world import Pair, Scheme, World
from symphys.records import dataclass
from symphys.types import Expr

MIN_KICK_SHARE = 1 / 8
"""Least time over which impulses act as forces, as a share of dt; see ``StepContext.shortest_kick``."""
MAX_REST_GAP = 0.1
"""Largest gap of surfaces that carried load and go on touching, as a share of the distance a_ref dt^2."""
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
        """Return the speed [m/s] of approach above which a contact is an impact, not rest."""
        return 2 * self.reference * self.scheme.dt


@dataclass(frozen=True)
class StepContext:
    """World, settings and inputs, constant over a step.

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
        """Yield the pairs, and whether they may act."""
        return zip(self.world.pairs, self.near or [ca.SX(1)] * len(self.world.pairs), strict=True)

    def input(self, name: str) -> Expr | None:
        """Return the input of this name; None if there is none."""
        columns = input_columns(self.world, self.inputs).get(name)
        return None if columns is None else self.u[columns]

    @property
    def shortest_kick(self) -> Expr:
        """Return the least time [s] over which impulses of a substep are stored as forces; an impact adds no force."""
        return MIN_KICK_SHARE * self.settings.scheme.dt


def make_context(world: World, scheme: Scheme | None, inputs: tuple[str, ...], u: Expr, smoothing: Expr) -> StepContext:
    """Return the context of a world."""
    gravity = ca.vertcat(*world.gravity)
    settings = StepSettings(scheme or Scheme(), gravity, smoothing, reference(gravity))
    return StepContext(world, settings, inputs, u)


@traced
def reference(gravity: Expr) -> Expr:
    """Return |gravity|, at least 1 m/s^2."""
    return ca.fmax(ca.sqrt(ca.dot(gravity, gravity) + TINY_SQUARE), MIN_REFERENCE_ACCELERATION)
