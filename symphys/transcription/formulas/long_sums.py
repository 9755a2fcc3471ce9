"""Sums over all samples of a motion as short calls, one after the other, for the compiled kernels.

As one function they are as long as the motion: that of ten seconds of a quadruped has 230,000 operations, and takes the
compiler two thirds of its time. The order of the sums is that of casadi's, so that no bit differs.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from symphys.codegen import FunctionCall, MemoryLayout, Place
from symphys.types import Expr

CHUNK = 64
"""Numbers that a call adds up."""


def sums_in_calls(
    layout: MemoryLayout, series: Sequence[Place], rows: int, scale: float | None
) -> tuple[list[FunctionCall], Place]:
    """Calls that add up samples, and where the result lies.

    Args:
        layout: takes what the calls give.
        series: places of samples, ``rows`` numbers each, one after the other.
        rows: m.
        scale: of the squares; None: there are none.

    Returns:
        The calls, and the place of the sum (m,) of the samples with, after it, that of the squares of scale times each
        number.
    """
    count = rows + (scale is not None)
    calls, chunks = list[FunctionCall](), dict[int, ca.Function]()
    total = layout.take(count)
    calls.append(FunctionCall(ca.Function("zeros", [], [ca.DM.zeros(count)]), (), (total,)))
    longest = max(CHUNK // rows, 1) * rows
    for whole in series:
        for start in range(0, whole.size, longest):
            part, after = Place(whole.offset + start, min(longest, whole.size - start)), layout.take(count)
            if part.size not in chunks:
                chunks[part.size] = _chunk(rows, part.size // rows, scale)
            calls.append(FunctionCall(chunks[part.size], (total, part), (after,)))
            total = after
    return calls, total


def _chunk(rows: int, columns: int, scale: float | None) -> ca.Function:
    """(sums before, samples) -> sums after."""
    before, samples = ca.SX.sym("before", rows + (scale is not None)), ca.SX.sym("samples", rows * columns)
    after: list[Expr] = [before[i] for i in range(before.numel())]
    for k in range(rows * columns):
        after[k % rows] += samples[k]
        if scale is not None:
            scaled = scale * samples[k]
            after[rows] += scaled * scaled
    return ca.Function("sums", [before, samples], [ca.vertcat(*after)])
