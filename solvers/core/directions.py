"""Directions of first-order descent, made from the gradient in x = z / scale.

gradient   d = -rate g
momentum   m <- momentum m + g,  d = -rate m                                 (Polyak 1964, heavy ball)
adam       m <- b1 m + (1 - b1) g,  v <- b2 v + (1 - b2) g^2,  d = -rate m^ / (sqrt(v^) + 1e-8)
with m^, v^ freed of their bias                                   (Kingma and Ba 2015, algorithm 1)
spectral   d = -a g,  a = s.y / y.y, from the last step s and the change y of the gradient
(Barzilai and Borwein 1988, the shorter of their two steps: the steadier one in bent valleys)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from symphys.records import dataclass
from symphys.types import Array

ADAM_FLOOR = 1e-8
"""Added to Adam's root mean square gradient, as in the paper."""
MAX_SPECTRAL_STEP = 1e12
"""Bound of a spectral step and of its inverse."""
NEGATIVE_CURVATURE_GROWTH = 10.0
"""Factor on the spectral step where the merit curves downward and suggests no length."""


@dataclass(frozen=True)
class DirectionMemory:
    """The memory of a direction: running means of past gradients, and a step length.

    Attributes:
        ticks: gradients since the memory was empty.
        mean, square: (n,) running means of the gradient and of its square.
        length: the spectral step a; 0 before the first step.
    """

    ticks: int
    mean: Array
    square: Array
    length: float

    @classmethod
    def empty(cls, n: int) -> DirectionMemory:
        """Return the memory before the first gradient."""
        return cls(0, np.zeros(n), np.zeros(n), 0.0)


@dataclass(frozen=True)
class MomentumWeights:
    """Weights of past gradients: ``momentum`` and ``betas`` of ``GradientOptions``."""

    momentum: float
    betas: tuple[float, float]


Direction = Callable[[Array, DirectionMemory, float, MomentumWeights], tuple[Array, DirectionMemory]]
"""(scaled gradient, memory, rate, weights) -> (direction, memory)."""


def plain(g: Array, memory: DirectionMemory, rate: float, weights: MomentumWeights) -> tuple[Array, DirectionMemory]:
    """Return the negative gradient."""
    return -rate * g, memory


def momentum(g: Array, memory: DirectionMemory, rate: float, weights: MomentumWeights) -> tuple[Array, DirectionMemory]:
    """Return the heavy-ball direction."""
    mean = weights.momentum * memory.mean + g
    return -rate * mean, replace(memory, mean=mean)


def adam(g: Array, memory: DirectionMemory, rate: float, weights: MomentumWeights) -> tuple[Array, DirectionMemory]:
    """Return Adam's direction: each component divided by its root mean square."""
    b1, b2 = weights.betas
    ticks = memory.ticks + 1
    mean = b1 * memory.mean + (1 - b1) * g
    square = b2 * memory.square + (1 - b2) * g * g
    spread = np.sqrt(square / (1 - b2**ticks)) + ADAM_FLOOR
    return -rate * mean / (1 - b1**ticks) / spread, replace(memory, ticks=ticks, mean=mean, square=square)


def spectral(g: Array, memory: DirectionMemory, rate: float, weights: MomentumWeights) -> tuple[Array, DirectionMemory]:
    """Return a step whose length the last change of the gradient suggests; the first has the length ``rate``."""
    length = memory.length or rate / max(float(np.linalg.norm(g)), 1 / MAX_SPECTRAL_STEP)
    return -length * g, replace(memory, length=length)


DIRECTIONS: dict[str, Direction] = {"spectral": spectral, "gradient": plain, "momentum": momentum, "adam": adam}


def learn_length(memory: DirectionMemory, s: Array, y: Array) -> DirectionMemory:
    """Return the memory with the spectral length after a step s that changed the gradient by y."""
    curvature = float(s @ y)
    length = curvature / float(y @ y) if curvature > 0 else NEGATIVE_CURVATURE_GROWTH * memory.length
    return replace(memory, length=min(max(length, 1 / MAX_SPECTRAL_STEP), MAX_SPECTRAL_STEP))
