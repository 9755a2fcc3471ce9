"""Calling a casadi function without its overhead: 0.1 us by buffers, against 15 us for ``function(z, smoothing)``."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symphys.codegen.backends.interface import Function
from symphys.types import Array


class BufferedFunction:
    """A casadi function of (z, smoothing) for a batch of fixed size, with dense numpy arrays."""

    def __init__(self, function: Function, batch: int = 1, threads: int = 1) -> None:
        """Keep buffers for the arguments and for the nonzeros of each result."""
        self.function = mapped(function, batch, threads)
        self.shapes = [(batch, function.size2_out(i), function.size1_out(i)) for i in range(function.n_out())]
        self.Z, self.smoothing = np.zeros((batch, function.numel_in(0))), np.zeros(batch)
        sparsities = [self.function.sparsity_out(i) for i in range(function.n_out())]
        self.places = [np.array(sparsity.find(), int) for sparsity in sparsities]
        self.nonzeros = [np.zeros(places.size) for places in self.places]
        self.buffer, self.evaluate = self.function.buffer()
        self.buffer.set_arg(0, self.Z.reshape(-1).data)
        self.buffer.set_arg(1, self.smoothing.data)
        for index, values in enumerate(self.nonzeros):
            self.buffer.set_res(index, values.data)

    def __call__(self, Z: Array, smoothing: float) -> list[Array]:
        """Evaluate at Z (batch, n); RuntimeError where casadi fails.

        A result of k numbers is (batch, k), a matrix (batch, rows, columns); all are copies.
        """
        self.Z[:] = Z
        self.smoothing[:] = smoothing
        self.evaluate()
        if self.buffer.ret():
            raise RuntimeError(f"the evaluation of {self.function.name()} failed")
        return [dense(*each) for each in zip(self.shapes, self.places, self.nonzeros, strict=True)]


def row_by_row(function: Function, *arguments: ArrayLike) -> list[Array]:
    """Return a function of dense arguments (B, n) with dense results (B, size); RuntimeError where casadi fails.

    Arguments (n,) are the same in all rows. A matrix is an argument (B, columns, rows) and a result column after
    column. Numbers go from arrays to arrays: casadi takes half a millisecond to hand over 16,000 of them as a ``DM``.
    Rows are calls, one after the other: to make a function of 64 rows (``map``) took ten times as long as these.
    """
    given = [np.asarray(argument, float) for argument in arguments]
    count = next((len(argument) for argument in given if argument.ndim > 1), 1)
    flat = [each.reshape(count, each.size // max(count, 1)) if each.ndim > 1 else each for each in given]
    rows = np.concatenate([np.broadcast_to(each, (count, each.shape[-1])) for each in flat], axis=1)
    places = [np.array(function.sparsity_out(i).find(), int) for i in range(function.n_out())]
    # One call after the other, from and to rows that stay where they are.
    row, result = np.zeros(rows.shape[1]), np.zeros(sum(own.size for own in places))
    nonzeros = np.zeros((count, result.size))
    buffer, evaluate = function.buffer()
    begins = np.cumsum([0, *(each.shape[-1] for each in flat)]).tolist()
    for i, (begin, end) in enumerate(pairwise(begins)):
        buffer.set_arg(i, row[begin:end].data)
    ends = np.cumsum([0, *(own.size for own in places)]).tolist()
    for i, (begin, end) in enumerate(pairwise(ends)):
        buffer.set_res(i, result[begin:end].data)
    failed = buffer.ret
    for k in range(count):
        row[:] = rows[k]
        evaluate()
        if failed():
            raise RuntimeError(f"the evaluation of {function.name()} failed")
        nonzeros[k] = result
    found = [np.zeros((count, function.numel_out(i))) for i in range(function.n_out())]
    for into, own, begin in zip(found, places, ends, strict=False):
        into[:, own] = nonzeros[:, begin : begin + own.size]
    return found


def mapped(function: Function, batch: int, threads: int) -> Function:
    """Return the function for so many columns at once."""
    if batch == 1:
        return function
    return function.map(batch) if threads == 1 else function.map(batch, "thread", min(batch, threads))


def dense(shape: tuple[int, int, int], places: NDArray[np.int_], nonzeros: Array) -> Array:
    """Return a dense copy of a result whose nonzeros are stored, at ``places`` counted column after column."""
    full = np.zeros(shape)
    full.reshape(-1)[places] = nonzeros
    return full[:, 0] if shape[1] == 1 else full.transpose(0, 2, 1)
