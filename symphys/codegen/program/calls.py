"""Calls of functions on places of a memory."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from symphys.records import dataclass

Function = Any
"""casadi Function of SX type"""


@dataclass(frozen=True)
class Place:
    """Words ``offset + k stride`` to ``offset + k stride + size`` of the memory, at time step k.

    Outside the body k is 0, so that the stride does not matter there.
    """

    offset: int
    size: int
    stride: int = 0

    def words(self, steps: int) -> NDArray[np.int64]:
        """Return the words that it covers (steps, size), a row for each step; (1, size) without stride."""
        count = steps if self.stride else 1
        return self.offset + self.stride * np.arange(count)[:, None] + np.arange(self.size)

    def still(self) -> Place:
        """Return the place at step 0, for calls outside the body."""
        return Place(self.offset, self.size)

    def later(self, steps: int = 1) -> Place:
        """Return the place that many steps later: with a stride, what the next step finds under its own number."""
        return Place(self.offset + steps * self.stride, self.size, self.stride)


@dataclass(frozen=True)
class FunctionCall:
    """One call of a function.

    Attributes:
        function: SX Function of dense vectors without free symbols; equal functions are compiled once.
        inputs: where its arguments lie.
        outputs: where its results go. They are written, or added to what is there if ``accumulate``.
        guard: a word of scratch; where it is 0 the call may be left out, as it then gives what ``otherwise`` has.
        otherwise: for each result the place that holds the same then; None where no call reads it then.
        section: the same for a run of calls that have one word in common, which are left out together.
        beside: what ``otherwise`` is, for the section.
    """

    function: Function
    inputs: tuple[Place, ...]
    outputs: tuple[Place, ...]
    accumulate: bool = False
    guard: Place | None = None
    otherwise: tuple[Place | None, ...] = ()
    section: Place | None = None
    beside: tuple[Place | None, ...] = ()


@dataclass(frozen=True)
class AdjointDiscount:
    """The discount of adjoints on their way back through time.

    Attributes:
        state: of a step, with a stride: its adjoint is shortened when the adjoint of the step before begins.
        kept: a word of each step, 1 or 0: where it is 0, the adjoint ends. None: it is 1 everywhere.
    """

    state: Place
    kept: Place | None = None
