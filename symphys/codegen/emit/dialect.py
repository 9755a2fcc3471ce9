"""Dialects of C: vectors of lanes, single numbers in plain C, a thread of a device."""

from __future__ import annotations

from collections.abc import Mapping

from symphys.codegen.graph.operations import FORMS, PLAIN, SCALAR
from symphys.records import dataclass


@dataclass(frozen=True)
class Dialect:
    """Words for what a function does, whatever computes it.

    Attributes:
        forms: expressions of operations.
        reads: type of what is only read.
        writes: type of what nothing else overlaps.
        shares: type of results that may coincide with one another.
        word: a word of a place, by the place's name and the number of the word.
        inline: how a function begins that its only caller takes in; ``apart``: one that it does not.
        entry: how a function begins that the driver calls.
        memory: type of the memories.
        both: a statement for sine and cosine of a number at once; empty: none.
        fuses: whether adjoints have fused products, written out: all compilers give the same bits, at any level.
        ahead: loads that come together, ahead of what uses them; 0: each where it is used.
        dense: whether places are numbers of 32 bits without strides, not pairs of words.
    """

    forms: Mapping[str, str]
    reads: str = "const V *"
    writes: str = "V *restrict "
    shares: str = "V *"
    word: str = "{0}[{1}]"
    inline: str = "static inline void"
    apart: str = "static NOINLINE void"
    entry: str = "void"
    memory: str = "V *"
    both: str = "sincos_({0}, &{1}, &{2})"
    fuses: bool = True
    ahead: int = 0
    dense: bool = False

    @property
    def table(self) -> str:
        """Return the type of the table of places."""
        return "const int32_t *" if self.dense else "const word *"


VECTORS = Dialect(FORMS)
NUMBERS = Dialect(PLAIN, both="", fuses=False)
ONE_LANE = Dialect(SCALAR)
PACK = Dialect(FORMS, reads="const R *", writes="R *restrict ", shares="R *", memory="R *")
"""Several calls of one rollout at once: lanes are calls, and memories are those of one lane."""
DEVICE = Dialect(
    PLAIN,
    reads="const V *restrict ",
    word="{0}[{1} * LANES]",
    inline="static __device__ __forceinline__ void",
    apart="static __device__ __noinline__ void",
    both="",
    entry='extern "C" __device__ void',
    fuses=False,
    ahead=64,
)
"""Memories are interleaved: LANES apart lie the words of one thread."""
