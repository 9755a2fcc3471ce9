"""Slopes and curvature of terms, by tangents: expressions of what is not 0, and the blocks that their numbers fill."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from symphys.transcription.staged.stage_functions import ReadingFunction, reading
from symphys.transcription.staged.stage_terms import StageSymbols, StageTerm
from symphys.types import Array, Expr, Ints


class Block(NamedTuple):
    """Slopes (T, r, c) by some entries ``columns`` (c,) of an argument."""

    slopes: Array
    columns: Ints


class Blocks(NamedTuple):
    """Slopes of a term's rows at its steps.

    Attributes:
        x: by the tangent of the state that it looks at.
        first: by the tangent of the state before, where that is another one.
        u: by inputs.
        constants: by what is the same all along the motion.
    """

    x: Block
    first: Block
    u: Block
    constants: Block


@dataclass(frozen=True)
class Pattern:
    """Where the nonzeros of a matrix go: into dense blocks of its columns that have any."""

    shape: tuple[int, int]
    rows: Ints
    places: Ints
    columns: Ints

    @staticmethod
    def of(matrix: Expr) -> Pattern:
        """Of a sparse expression (r, c)."""
        rows, columns = (np.array(each, np.int64) for each in matrix.sparsity().get_triplet())
        kept, places = np.unique(columns, return_inverse=True)
        return Pattern((matrix.shape[0], len(kept)), rows, places.astype(np.int64), kept.astype(np.int64))

    def block(self, nonzeros: Array) -> Block:
        """(T, nnz) -> the block."""
        dense = np.zeros((len(nonzeros), *self.shape))
        dense[:, self.rows, self.places] = nonzeros
        return Block(dense, self.columns)


@dataclass(frozen=True, eq=False)
class TermSlopes:
    """What a compiled function gives of a term, and how its numbers become blocks.

    Attributes:
        function: -> value, nonzeros of four slopes; of a cost or sum then its second derivative and the rows of the
            tangents that this needs.
        slopes: patterns of the four.
        curved: of the second derivative, None where there is none: it is by some entries of all arguments.
        parts: (4,) which entries of ``curved`` are of which argument.
        bases: patterns of the rows of tangents by the first and second of these.
        acting: (4) entries of the arguments themselves.
    """

    function: ReadingFunction
    slopes: tuple[Pattern, ...]
    curved: Pattern | None
    parts: tuple[slice, ...]
    bases: tuple[Pattern, ...]
    acting: tuple[Ints, ...]

    def values(self, found: Sequence[Array]) -> tuple[Array, Blocks]:
        """(T, r) values and their slopes."""
        return found[0], Blocks(*(each.block(part) for each, part in zip(self.slopes, found[1:5], strict=True)))

    def curvature(self, found: Sequence[Array], sign: Array | float = 1.0) -> Blocks | None:
        """Rows whose squares have the second derivative of ``sign`` (T,) times the value, made positive semidefinite.

        None for a value that is linear.
        """
        if self.curved is None:
            return None
        second = self.curved.block(found[5] * np.reshape(sign, (-1, 1))).slopes
        rows = square_roots(second, _components(self.curved))
        by = [rows[:, :, part] for part in self.parts]
        tangents = [each.block(part) for each, part in zip(self.bases, found[6:8], strict=True)]
        moved = [Block(each @ basis.slopes, basis.columns) for each, basis in zip(by, tangents, strict=False)]
        return Blocks(moved[0], moved[1], *(Block(by[i], self.acting[i]) for i in (2, 3)))


def term_slopes(symbols: StageSymbols, term: StageTerm, known: dict[Any, TermSlopes]) -> TermSlopes:
    """The slopes of a term; of a formula that looks at either side of a step they are built once, see ``known``."""
    if term.key in known:
        shared = known[term.key]
        function = ReadingFunction(shared.function.function, shared.function.reads, term.after)
        return TermSlopes(function, shared.slopes, shared.curved, shared.parts, shared.bases, shared.acting)
    value, arguments = term.value, symbols.arguments[:4]
    raw = [ca.sparsify(ca.jacobian(value, each)) for each in arguments]
    moved = [_times(raw[i], symbols.bases[i]) if raw[i].nnz() else ca.SX(value.shape[0], 0) for i in (0, 1)]
    constants: Expr = raw[3]
    if symbols.shifts is not None:
        for slope, shift in zip(raw[:2], symbols.shifts, strict=True):
            more = symbols.constants.shape[0] - symbols.parameter_size
            constants = constants + ca.horzcat(_times(slope, shift), ca.SX(value.shape[0], more))
    slopes = [*moved, raw[2], constants]
    second, acting = _second(value, arguments) if term.kind in ("cost", "sum") else (None, ())
    bases = [symbols.bases[i][acting[i].tolist(), :] if len(acting[i]) else ca.SX(0, 0) for i in (0, 1) if acting]
    results = [value, *(_nonzeros(each) for each in slopes)]
    parts: tuple[slice, ...] = ()
    if second is not None:
        results += [_nonzeros(second), *(_nonzeros(each) for each in bases)]
        ends = np.cumsum([0, *(len(each) for each in acting)]).tolist()
        parts = tuple(slice(*pair) for pair in pairwise(ends))
    found = TermSlopes(
        reading(results, symbols.arguments, term.after),
        tuple(Pattern.of(each) for each in slopes),
        None if second is None else Pattern.of(second),
        parts,
        tuple(Pattern.of(each) for each in bases) if second is not None else (),
        acting,
    )
    known[term.key] = found
    return found


def raw_slopes(symbols: StageSymbols, term: StageTerm) -> ReadingFunction:
    """-> dense slopes of a term by the whole of ``x`` and of ``first``, one after the other."""
    slopes = [ca.densify(ca.jacobian(term.value, each)) for each in symbols.arguments[:2]]
    return reading([ca.vec(each.T) for each in slopes], symbols.arguments, term.after)


def square_roots(second: Array, components: Sequence[Ints]) -> Array:
    """(T, a, a) rows whose squares sum to the positive part of symmetric matrices (T, a, a), component by component."""
    rows = np.zeros_like(second)
    for each in components:
        if len(each) == 1:
            i = int(each[0])
            rows[:, i, i] = np.sqrt(np.maximum(second[:, i, i], 0.0))
            continue
        part = second[:, each[:, None], each[None, :]]
        numbers, vectors = np.linalg.eigh((part + part.transpose(0, 2, 1)) / 2)
        roots = np.sqrt(np.maximum(numbers, 0.0))[:, :, None] * vectors.transpose(0, 2, 1)
        rows[:, each[:, None], each[None, :]] = roots
    return rows


def _components(pattern: Pattern) -> list[Ints]:
    """Which entries a second derivative ties together."""
    size = pattern.shape[0]
    from scipy.sparse import csr_array  # late: most solvers take no problem step by step
    from scipy.sparse.csgraph import connected_components

    graph = csr_array((np.ones(len(pattern.rows)), (pattern.rows, pattern.places)), shape=(size, size))
    count, labels = connected_components(graph, directed=False)
    return [np.flatnonzero(labels == i) for i in range(count)]


def _second(value: Expr, arguments: Sequence[Expr]) -> tuple[Expr | None, tuple[Ints, ...]]:
    """The second derivative of a number by the entries in which it is not linear, and which these are."""
    slopes = [ca.sparsify(ca.jacobian(value, each)) for each in arguments]
    used = [np.unique(np.array(each.sparsity().get_triplet()[1], np.int64)) for each in slopes]
    entries = ca.vertcat(ca.SX(0, 1), *(a[u.tolist()] for a, u in zip(arguments, used, strict=True) if len(u)))
    second = ca.sparsify(ca.jacobian(ca.jacobian(value, entries), entries))
    curved = np.unique(np.array(second.sparsity().get_triplet()[1], np.int64))
    if not len(curved):
        return None, ()
    ends = np.cumsum([0, *(len(each) for each in used)])
    acting = tuple(
        each[curved[(curved >= a) & (curved < b)] - a] for each, a, b in zip(used, ends[:-1], ends[1:], strict=True)
    )
    return second[curved.tolist(), curved.tolist()], acting


def _times(slope: Expr, matrix: Expr) -> Expr:
    """Their product, of the columns that the first one has."""
    columns = np.unique(np.array(slope.sparsity().get_triplet()[1], np.int64)).tolist()
    return (
        ca.sparsify(ca.mtimes(slope[:, columns], matrix[columns, :]))
        if columns
        else ca.SX(slope.shape[0], matrix.shape[1])
    )


def _nonzeros(matrix: Expr) -> Expr:
    return ca.vertcat(ca.SX(0, 1), *matrix.nonzeros())
