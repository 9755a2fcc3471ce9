"""The shooting problem: all that a solver sees, as named casadi functions of one decision vector z."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Function = Any
"""casadi.Function"""


@dataclass(frozen=True)
class Block:
    """One named part of z, flattened knot after knot.

    Attributes:
        name: the variable's name in the problem file.
        start: index of its first entry in z.
        shape: (components, knots).
        guess, lower, upper, scale, spread: (components * knots,); ``scale`` is the size of a typical change,
            ``spread`` the standard deviation with which a seed perturbs the guess.
    """

    name: str
    start: int
    shape: tuple[int, int]
    guess: Array
    lower: Array
    upper: Array
    scale: Array
    spread: Array

    @property
    def stop(self) -> int:
        """One past the index of its last entry in z."""
        return self.start + self.shape[0] * self.shape[1]


@dataclass(frozen=True)
class ShootingProblem:
    """Minimise objective(z) within bounds and constraints; every function takes (z, smoothing).

    ``merit`` is the objective plus the quadratic penalty of violated constraints, for solvers that know no
    constraints; without constraints both are the same. ``errors`` holds one number per target, constraint and goal,
    divided by its tolerance: met where <= 1.

    Attributes:
        name: the problem's name.
        blocks: the parts of z, in order.
        value: -> (merit, objective, errors).
        gradient: -> (merit, objective, errors, d merit / dz (n,)).
        residuals: -> (r, objective, errors) with merit = r . r; None where a cost is no sum of squares.
        jacobian: -> (r, objective, errors, dr/dz (m, n)); None likewise.
        nlp: -> (objective, constraints): one casadi function to be called on symbols by NLP solvers.
        constraint_names: one per entry of the constraints.
        constraint_lower, constraint_upper: (m,).
        smoothing: the knob that solvers use unless told otherwise.
        stop_when_met: stop at the first point whose errors are all <= 1, instead of at a stationary point.
    """

    name: str
    blocks: tuple[Block, ...]
    value: Function
    gradient: Function
    residuals: Function | None
    jacobian: Function | None
    nlp: Function
    constraint_names: tuple[str, ...] = ()
    constraint_lower: Array = field(default_factory=lambda: np.zeros(0))
    constraint_upper: Array = field(default_factory=lambda: np.zeros(0))
    smoothing: float = 0.0
    stop_when_met: bool = True

    @property
    def n(self) -> int:
        """Length of z."""
        return self.blocks[-1].stop if self.blocks else 0

    def stacked(self, name: str) -> Array:
        """(n,): ``guess``, ``lower``, ``upper``, ``scale`` or ``spread`` of all blocks in the order of z."""
        return np.concatenate([getattr(block, name) for block in self.blocks] or [np.zeros(0)])

    def start(self, seed: int) -> Array:
        """(n,): the guess; seeds above 0 perturb it by ``spread`` times standard normals, clipped into the bounds."""
        guess = self.stacked("guess")
        if seed > 0:
            noise = np.random.default_rng([seed, 0]).standard_normal(self.n)
            guess = guess + self.stacked("spread") * noise
        return np.clip(guess, self.stacked("lower"), self.stacked("upper"))

    def by_block(self, z: Array) -> dict[str, Array]:
        """Z cut into (components, knots) arrays by name."""
        return {b.name: z[b.start : b.stop].reshape(b.shape, order="F") for b in self.blocks}

    def from_blocks(self, values: Mapping[str, Array]) -> Array:
        """(n,): the inverse of ``by_block``."""
        return np.concatenate([np.asarray(values[b.name], float).ravel(order="F") for b in self.blocks])

    def met(self, errors: Array) -> bool:
        """Whether there is something to meet and all of it is met; NaN never is."""
        return errors.size > 0 and bool(np.all(errors <= 1))
