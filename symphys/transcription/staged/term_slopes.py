"""First and second derivatives of terms in tangents: nonzero entries as expressions, and the blocks that they fill."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from symphys.codegen.toolchain.warm_start import from_cache
from symphys.records import dataclass
from symphys.transcription.identities import terms_identity
from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.stage_functions import ReadingFunction, StageFunctions, StepRows, reading
from symphys.transcription.staged.stage_terms import (
    Kind,
    StageSymbols,
    StageTerm,
    motion_sums,
    reweighted,
    stage_terms,
)
from symphys.transcription.staged.tangent import Tangent
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
    """The places of a sparse matrix's nonzeros in dense blocks of its nonzero columns."""

    shape: tuple[int, int]
    rows: Ints
    places: Ints
    columns: Ints

    @staticmethod
    def of(matrix: Expr) -> Pattern:
        """Collect the nonzero entries of a sparse expression (r, c)."""
        rows, columns = (np.array(each, np.int64) for each in matrix.sparsity().get_triplet())
        kept, places = np.unique(columns, return_inverse=True)
        return Pattern((matrix.shape[0], len(kept)), rows, places.astype(np.int64), kept.astype(np.int64))

    def block(self, nonzeros: Array) -> Block:
        """Return the block of nonzeros (T, nnz)."""
        dense = np.zeros((len(nonzeros), *self.shape))
        dense[:, self.rows, self.places] = nonzeros
        return Block(dense, self.columns)


@dataclass(frozen=True, eq=False)
class TermSlopes:
    """The compiled derivatives of a term, and the blocks of its numbers.

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
        """Return values (T, r) and their slopes."""
        return found[0], Blocks(*(each.block(part) for each, part in zip(self.slopes, found[1:5], strict=True)))

    def curvature(self, found: Sequence[Array], sign: Array | float = 1.0) -> Blocks | None:
        """Return rows whose squares sum to the second derivative of ``sign`` (T,) times the value, made >= 0.

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
    """Return the slopes of a term; terms of one formula before and after a step share them, see ``known``."""
    if term.key in known:
        shared = known[term.key]
        function = ReadingFunction(shared.function.function, shared.function.reads, term.after)
        return TermSlopes(function, shared.slopes, shared.curved, shared.parts, shared.bases, shared.acting)
    identity = terms_identity(symbols.rollout, "slopes of a term", symbols.tangent.kind, term.key, term.after)
    kinds = TermSlopes, ReadingFunction, Pattern
    found = known[term.key] = from_cache(lambda: _made_slopes(symbols, term), identity, kinds)
    return found


def _made_slopes(symbols: StageSymbols, term: StageTerm) -> TermSlopes:
    # First derivatives in tangents; the second one where the term is no square.
    value, arguments = term.value, symbols.arguments[:4]
    slopes = tangent_slopes(symbols, value)
    second, acting = _second(value, arguments) if term.kind in ("cost", "sum") else (None, ())
    bases = [symbols.bases[i][acting[i].tolist(), :] if len(acting[i]) else ca.SX(0, 0) for i in (0, 1) if acting]
    # All nonzeros as results of one function.
    results = [value, *(nonzeros(each) for each in slopes)]
    parts: tuple[slice, ...] = ()
    if second is not None:
        results += [nonzeros(second), *(nonzeros(each) for each in bases)]
        ends = np.cumsum([0, *(len(each) for each in acting)]).tolist()
        parts = tuple(slice(*pair) for pair in pairwise(ends))
    return TermSlopes(
        reading(results, symbols.arguments, term.after),
        tuple(Pattern.of(each) for each in slopes),
        None if second is None else Pattern.of(second),
        parts,
        tuple(Pattern.of(each) for each in bases) if second is not None else (),
        acting,
    )


def tangent_slopes(symbols: StageSymbols, value: Expr) -> list[Expr]:
    """Return sparse slopes of a value (r,) by the tangents of ``x`` and ``first``, inputs and constants."""
    raw = [ca.sparsify(ca.jacobian(value, each)) for each in symbols.arguments[:4]]
    moved = [_sparse_product(raw[i], symbols.bases[i]) if raw[i].nnz() else ca.SX(value.shape[0], 0) for i in (0, 1)]
    constants: Expr = raw[3]
    if symbols.shifts is not None:
        for slope, shift in zip(raw[:2], symbols.shifts, strict=True):
            more = symbols.constants.shape[0] - symbols.parameter_size
            constants = constants + ca.horzcat(_sparse_product(slope, shift), ca.SX(value.shape[0], more))
    return [*moved, raw[2], constants]


def raw_slopes(symbols: StageSymbols, term: StageTerm) -> ReadingFunction:
    """Return a function to dense slopes of a term by all of ``x`` and of ``first``."""
    slopes = [ca.densify(ca.jacobian(term.value, each)) for each in symbols.arguments[:2]]
    return reading([ca.vec(each.T) for each in slopes], symbols.arguments, term.after)


def square_roots(second: Array, components: Sequence[Ints]) -> Array:
    """Return rows (T, a, a) whose squares sum to the positive part of symmetric matrices (T, a, a)."""
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
    """Return the pairs of entries with a nonzero second derivative."""
    size = pattern.shape[0]
    from scipy.sparse import csr_array  # late: most solvers take no problem step by step
    from scipy.sparse.csgraph import connected_components

    graph = csr_array((np.ones(len(pattern.rows)), (pattern.rows, pattern.places)), shape=(size, size))
    count, labels = connected_components(graph, directed=False)
    return [np.flatnonzero(labels == i) for i in range(count)]


def _second(value: Expr, arguments: Sequence[Expr]) -> tuple[Expr | None, tuple[Ints, ...]]:
    """Return the second derivative of a number by the entries in which it is nonlinear, and these entries."""
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


def _sparse_product(slope: Expr, matrix: Expr) -> Expr:
    """Return the product, restricted to the nonzero columns of the first factor."""
    columns = np.unique(np.array(slope.sparsity().get_triplet()[1], np.int64)).tolist()
    return (
        ca.sparsify(ca.mtimes(slope[:, columns], matrix[columns, :]))
        if columns
        else ca.SX(slope.shape[0], matrix.shape[1])
    )


def nonzeros(matrix: Expr) -> Expr:
    """Return the nonzeros of a sparse expression as a column."""
    return ca.vertcat(ca.SX(0, 1), *matrix.nonzeros())


MOTIONS_PER_CALL = 8
"""Motions that are evaluated in one call, as the step lengths of a line search."""


class _Group(NamedTuple):
    """Terms that are evaluated at the same steps, and whether these are sums."""

    numbers: list[int]
    sums: bool


class TermGroups:
    """All terms, with their values and slopes at their steps.

    Attributes:
        symbols: the arguments of the terms.
        terms: costs, targets and constraints in the problem's order, then sums.
        clock: [steps] the time at which state 0 is.
    """

    def __init__(self, rollout: Rollout, tangent: Tangent, backend: str, threads: int | None) -> None:
        """Collect the terms; functions are compiled on demand."""
        self.clock = 0.0
        self.symbols = StageSymbols(rollout, tangent, motion_sums(rollout))
        self.terms = stage_terms(self.symbols)
        self._backend, self._threads = backend, threads
        groups: dict[tuple[bytes, bool], list[int]] = {}
        for number, term in enumerate(self.terms):
            groups.setdefault((term.steps.tobytes(), term.kind == "sum"), []).append(number)
        self._groups = [_Group(numbers, sums) for (_, sums), numbers in groups.items()]
        # Functions, made when they are first asked for.
        self._slopes: dict[int, TermSlopes] = {}
        self._known: dict[Any, TermSlopes] = {}
        self._sloped: dict[frozenset[Kind], list[tuple[list[int], StageFunctions]]] = {}
        self._full_slope_functions: dict[Any, StageFunctions] = {}

    def weighted(self, rollout: Rollout) -> TermGroups:
        """Return the terms with the weights of a rollout that differs in these only; functions are shared."""
        _ = self._values
        found = copy(self)
        found.terms = reweighted(self.symbols, self.terms, rollout)
        return found

    def values(self, X: Array, U: Array, constants: Array) -> list[tuple[StageTerm, Array]]:
        """Return (B, T, r) of each term but sums, from states (B, N + 1, nx), inputs (B, N, m), constants (B, c)."""
        found: dict[int, Array] = {}
        for group, functions in zip(self._groups, self._values, strict=True):
            if group.sums:
                continue
            steps, batch = self.terms[group.numbers[0]].steps, len(X)
            parts = (X[:, steps], X[:, steps + 1], U[:, steps])
            before, after, u = (part.reshape(batch * len(steps), part.shape[2]) for part in parts)
            shared, ticks = np.repeat(constants, len(steps), axis=0), np.tile(steps, batch)
            rows = StepRows(before, after, u, shared, ticks, self.clock)
            for number, (value,) in zip(group.numbers, functions(rows), strict=True):
                found[number] = value.reshape(batch, len(steps), value.shape[1])
        return [(self.terms[number], found[number]) for number in sorted(found)]

    def summed(self, rows: StepRows) -> Array:
        """Return states (R, nx) after steps, whose sums are the previous ones plus those of the steps."""
        after = rows.after.copy()
        first = self.symbols.state_size
        for group, functions in zip(self._groups, self._values, strict=True):
            if group.sums:
                here = np.isin(rows.ticks, self.terms[group.numbers[0]].steps)
                if not here.any():
                    continue
                for number, (value,) in zip(group.numbers, functions(_rows(rows, here)), strict=True):
                    term = self.terms[number]
                    after[here, first + term.number] += term.weight * value[:, 0]
        return after

    def slopes(self, rows: StepRows, kinds: frozenset[Kind]) -> Iterator[tuple[StageTerm, TermSlopes, list[Array]]]:
        """Return the inputs of ``TermSlopes`` for terms of some kinds in order, a row for each step."""
        found: dict[int, list[Array]] = {}
        for numbers, functions in self._of_kinds(kinds):
            here = _rows(rows, self.terms[numbers[0]].steps)
            found.update(zip(numbers, functions(here), strict=True))
        return ((self.terms[number], self._slopes[number], found[number]) for number in sorted(found))

    def full_state_slopes(self, term: StageTerm, rows: StepRows) -> Array:
        """Return (r, nx) slopes of a term in step 0 by all numbers of the state before it."""
        key = term.key, term.after
        if key not in self._full_slope_functions:
            self._full_slope_functions[key] = StageFunctions([raw_slopes(self.symbols, term)], 1, "casadi", 1)
        ((x, first),) = self._full_slope_functions[key](_rows(rows, np.array([0])))
        found = first if term.after else x
        return found.reshape(term.size, -1)[:, : self.symbols.state_size]

    @cached_property
    def _values(self) -> list[StageFunctions]:
        def make() -> list[ReadingFunction]:
            first = {term.key: term for term in reversed(self.terms)}
            known = {key: reading([term.value], self.symbols.arguments, term.after) for key, term in first.items()}
            return [known[term.key] for term in self.terms]

        made = from_cache(
            make, terms_identity(self.symbols.rollout, "terms", [term.key for term in self.terms]), (ReadingFunction,)
        )
        pairs = zip(made, self.terms, strict=True)
        functions = [ReadingFunction(each.function, each.reads, term.after) for each, term in pairs]
        return [
            self._together([functions[i] for i in group.numbers], group.numbers, MOTIONS_PER_CALL)
            for group in self._groups
        ]

    def _of_kinds(self, kinds: frozenset[Kind]) -> list[tuple[list[int], StageFunctions]]:
        if kinds not in self._sloped:
            chosen = [[i for i in group.numbers if self.terms[i].kind in kinds] for group in self._groups]
            for number in sorted(i for numbers in chosen for i in numbers if i not in self._slopes):
                self._slopes[number] = term_slopes(self.symbols, self.terms[number], self._known)
            made = ((each, [self._slopes[i].function for i in each]) for each in chosen if each)
            self._sloped[kinds] = [(each, self._together(functions, each, 1)) for each, functions in made]
        return self._sloped[kinds]

    def _together(self, functions: Sequence[ReadingFunction], numbers: list[int], motions: int) -> StageFunctions:
        """Return functions of terms at the same steps, for ``motions`` motions at once."""
        steps = motions * len(self.terms[numbers[0]].steps)
        return StageFunctions(functions, steps, self._backend, self._threads)


def _rows(rows: StepRows, here: Any) -> StepRows:
    """Select rows."""
    constants = rows.constants if len(rows.constants) == 1 else rows.constants[here]
    return StepRows(rows.before[here], rows.after[here], rows.u[here], constants, rows.ticks[here], rows.clock)
