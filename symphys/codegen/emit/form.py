"""Forms of functions: what of the memory they read and write."""

from __future__ import annotations

from symphys.records import dataclass


@dataclass(frozen=True)
class Form:
    """The way in which a graph reads and writes the memory.

    Attributes:
        primal: how many of its arguments are places of the memory; the others are places of the adjoint memory.
        adds: results are added to what is there.
        backward: results go to the adjoint memory.
        clears: the adjoint arguments are zeroed when they have been read.
        shared: what it reads of the memory is one number for all lanes.
    """

    primal: int
    adds: bool
    backward: bool = False
    clears: bool = False
    shared: bool = False
