"""How far apart two surfaces are, as a function of where their bodies are and of the parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import groupby

import casadi as ca
import numpy as np

from symphys.dynamics.collision import collide
from symphys.dynamics.collision.predicted_path import PredictedPath, at_rest
from symphys.maths import rotation
from symphys.model.world import Pair
from symphys.transcription import Rollout
from symphys.types import Array, Expr
from symphys.verification.bodies import parameters


@dataclass(frozen=True, eq=False)
class SurfacePair:
    """Two surfaces that may touch.

    Attributes:
        name: of the contact, without the number of a point.
        columns: of its points, in what is recorded of contacts.
        pair: its first point.
    """

    rollout: Rollout
    name: str
    columns: tuple[int, ...]
    pair: Pair

    @property
    def first(self) -> int:
        """The index of the first body."""
        assert self.pair.first.body is not None
        return self.pair.first.body

    @property
    def second(self) -> int | None:
        """The index of the second body; None for what is static."""
        return self.pair.second.body

    @property
    def bodies(self) -> tuple[int, ...]:
        """Those that can move."""
        return (self.first,) if self.second is None else (self.first, self.second)

    @cached_property
    def gaps(self) -> ca.Function:
        """(pose of the first body (7,), of the second (7,), p) -> (points,) [m]; a pose is position and orientation."""
        world, poses = self.rollout.world, [ca.SX.sym("pose", 7) for _ in range(2)]
        surfaces = world.surface(self.pair.first), world.surface(self.pair.second)
        static = at_rest(ca.SX(self.rollout.dt))
        second = static if self.second is None else _resting(poses[1], self.rollout.dt)
        found = [contact.gap for contact in collide(*surfaces, _resting(poses[0], self.rollout.dt), second)]
        return ca.Function("gaps", [*poses, parameters(self.rollout)], [ca.densify(ca.vertcat(*found))])

    def least(self, poses: Array, p: Array) -> Array:
        """(m,) [m]: the smallest gap of all points, for ``poses`` (m, 2, 7)."""
        count = len(poses)
        found = self.gaps.map(count)(poses[:, 0].T, poses[:, 1].T, np.tile(p[:, None], count))
        least: Array = np.array(found).min(axis=0)
        return least


def surface_pairs(rollout: Rollout) -> list[SurfacePair]:
    """All of them, in the order of the world's pairs."""
    found = []
    numbered = enumerate(rollout.world.pairs)
    for _, group in groupby(numbered, key=lambda entry: (entry[1].first, entry[1].second)):
        columns, pairs = zip(*group, strict=True)
        found.append(SurfacePair(rollout, pairs[0].name.partition(":")[0], tuple(columns), pairs[0]))
    return found


def _resting(pose: Expr, dt: float) -> PredictedPath:
    zero = ca.SX.zeros(3)
    return PredictedPath(pose[:3], rotation.matrix(pose[3:]), zero, zero, zero, zero, ca.SX(dt), None, None)
