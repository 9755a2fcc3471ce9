"""Squares and limits about a motion to second order, their slopes stacked in one matrix.

A term that looks at one state alone is a row at each of the N + 1 states, whichever steps ask for it: formulas that
running costs read at either side of a step are evaluated once. A term of the state after a step that also looks at what
leads there is a row at each of the N steps. With rows r, slopes S and weights w the objective sum w r . r has the slope
2 S' w r and the Gauss-Newton curvature 2 S' w S.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from symphys.codegen.toolchain.warm_start import from_cache
from symphys.shooting import Expansion
from symphys.transcription.identities import terms_identity
from symphys.transcription.staged.stage_functions import ReadingFunction, StageFunctions, StepRows, reading
from symphys.transcription.staged.stage_terms import StageSymbols, StageTerm
from symphys.transcription.staged.term_slopes import Block, Blocks, nonzeros, tangent_slopes
from symphys.types import Array, Expr, Ints


class ExpansionSums:
    """An expansion while it is being summed.

    Slopes are complete. Curvature is kept where an expansion has a place for it: of two different states, and of
    control knots that are named together with what happens at other steps, it is left out.
    """

    def __init__(self, sizes: tuple[int, int, int, int], of_constants: Array, knots: tuple[Ints, Ints]) -> None:
        """Start with zeros.

        Args:
            sizes: N, n, m and s.
            of_constants: (c, s) what the terms' constants do with the static entries of z.
            knots: the constants that are knots of controls (k,), with step and input of each (k, 2).
        """
        steps, n, m, s = sizes
        self.of_constants, self.knots = of_constants, knots
        self.value = 0.0
        self.x, self.xx = np.zeros((steps + 1, n)), np.zeros((steps + 1, n, n))
        self.u, self.uu = np.zeros((steps, m)), np.zeros((steps, m, m))
        self.ux, self.uy = np.zeros((steps, m, n)), np.zeros((steps, m, n))
        self.s, self.ss = np.zeros(s), np.zeros((s, s))
        self.sx, self.su = np.zeros((steps + 1, s, n)), np.zeros((steps, s, m))

    def slope(self, term: StageTerm, blocks: Blocks, by_s: Array, weight: Array) -> None:
        """Add the slope of ``weight`` (T, r) times the term's values; ``by_s`` (T, r, s): slopes by static entries."""
        steps = term.steps
        for total, ticks, block in (
            (self.x, term.states, blocks.x),
            (self.x, steps, blocks.first),
            (self.u, steps, blocks.u),
        ):
            if len(block.columns):
                total[ticks[:, None], block.columns] += np.einsum("tr,trc->tc", weight, block.slopes)
        self.s += np.einsum("tr,trs->s", weight, by_s)
        knots, places = self.knots_of(blocks.constants)
        if len(places):
            np.add.at(self.u, (places[:, 0], places[:, 1]), np.einsum("tr,trc->c", weight, knots))

    def curvature(self, term: StageTerm, blocks: Blocks, by_s: Array, share: Array) -> None:
        """Add the second derivative of ``share`` / 2 (T, r) times the squares of rows with these slopes."""
        steps, states = term.steps, term.states
        scaled = share[:, :, None]
        x, first, u = (Block(each.slopes * scaled, each.columns) for each in blocks[:3])
        _add(self.xx, states, blocks.x, x)
        _add(self.xx, steps, blocks.first, first)
        _add(self.uu, steps, blocks.u, u)
        _add(self.uy if term.after else self.ux, steps, blocks.u, x)
        _add(self.ux, steps, blocks.u, first)
        if self.s.size and by_s.any():
            statics = Block(by_s, np.arange(self.s.size))
            self.ss += np.sum(by_s.transpose(0, 2, 1) @ (by_s * scaled), axis=0)
            _add(self.sx, states, statics, x)
            _add(self.sx, steps, statics, first)
            _add(self.su, steps, statics, u)
        self._of_knots(blocks.constants, by_s, scaled)

    def by_constants(self, slopes: Array) -> Array:
        """Return slopes (T, r, s) by the static entries of z, from those by all constants (T, r, c)."""
        return np.asarray(slopes @ self.of_constants)

    def by_statics(self, blocks: Blocks) -> Array:
        """Return slopes (T, r, s) by the static entries of z, through the constants."""
        return np.asarray(blocks.constants.slopes @ self.of_constants[blocks.constants.columns])

    def expansion(self) -> Expansion:
        """Return the expansion."""
        return Expansion(
            self.value, self.x, self.xx, self.u, self.uu, self.ux, self.uy, self.s, self.ss, self.sx, self.su
        )

    def knots_of(self, block: Block) -> tuple[Array, Ints]:
        """Return slopes (T, r, k) by knots among constants, and their places (k, 2)."""
        which, places = self.knots
        _, mine, theirs = np.intersect1d(block.columns, which, return_indices=True)
        return block.slopes[:, :, mine], np.asarray(places[theirs], np.int64)

    def _of_knots(self, block: Block, by_s: Array, scaled: Array) -> None:
        """Add second derivatives of knots of one step by each other and by static entries."""
        slopes, places = self.knots_of(block)
        for step in np.unique(places[:, 0]) if len(places) else ():
            here = places[:, 0] == step
            mine, columns = slopes[:, :, here], places[here, 1]
            self.uu[step][np.ix_(columns, columns)] += np.sum(mine.transpose(0, 2, 1) @ (mine * scaled), axis=0)
            if self.s.size:
                self.su[step][:, columns] += np.sum(by_s.transpose(0, 2, 1) @ (mine * scaled), axis=0)


def _add(total: Array, ticks: Ints, rows: Block, columns: Block) -> None:
    """Add columns of rows to total (N, a, b), tick by tick."""
    if len(rows.columns) and len(columns.columns):
        products = rows.slopes.transpose(0, 2, 1) @ columns.slopes
        total[ticks[:, None, None], rows.columns[:, None], columns.columns] += products


class StackSlopes(NamedTuple):
    """Values and slopes of stacked terms in tangents.

    Attributes:
        function: -> values (r,), nonzeros of their slopes.
        sizes: of the slopes by the tangents of ``x`` and ``first`` and by inputs, side by side.
        shape: of the slopes; more columns are by constants.
        places: (2, nonzeros) rows and columns of the nonzeros.
    """

    function: ReadingFunction
    sizes: tuple[int, int, int]
    shape: tuple[int, int]
    places: Ints


def stack_slopes(symbols: StageSymbols, values: Sequence[Expr], at_steps: bool, static: bool) -> StackSlopes:
    """Return values, each (r,), and their slopes; see ``SquareStack``."""
    stacked = ca.vertcat(ca.SX(0, 1), *values)
    x, first, u, constants = tangent_slopes(symbols, stacked)
    n = symbols.tangent.size + len(symbols.sums.sums)
    wide = (_padded(x, n), _padded(first, symbols.tangent.size if at_steps and first.nnz() else 0), u)
    slopes = ca.sparsify(ca.horzcat(*wide, constants if static else ca.SX(stacked.shape[0], 0)))
    function = reading([stacked, nonzeros(slopes)], symbols.arguments, at_steps)
    of_x, of_first, of_u = (int(each.shape[1]) for each in wide)
    places = np.array(slopes.sparsity().get_triplet(), np.int64)
    return StackSlopes(function, (of_x, of_first, of_u), slopes.shape, places)


Evaluated = tuple[str, int | None, int | None]
"""Backend, threads, and the operations of a horizon above which functions are compiled."""


class SquareStack:
    """Terms whose squares are summed, and limits, at all states of a motion or at all steps."""

    def __init__(
        self,
        symbols: StageSymbols,
        terms: Sequence[StageTerm],
        places: Mapping[int, slice],
        bounds: tuple[Array, Array],
        at_steps: bool,
        static: bool,
        evaluated: Evaluated,
    ) -> None:
        """Collect the slopes; functions are compiled on demand.

        Args:
            symbols: the arguments of the terms.
            terms: to stack.
            places: where limits are among all limits, by the ``id`` of the term.
            bounds: (c,) each, of all limits.
            at_steps: whether they look at both sides of a step; else they look at one state.
            static: whether z has static entries.
            evaluated: how; see ``StageFunctions``.
        """
        steps, self._at_steps = symbols.rollout.steps, at_steps
        rows = steps if at_steps else steps + 1
        distinct, weights, limits = list[StageTerm](), list[Array](), list[np.ndarray]()
        known: dict[tuple[object, ...], int] = {}
        for term in terms:
            limit = places.get(id(term))
            key = (*term.key, -1 if limit is None else limit.start)
            if key not in known:
                known[key] = len(distinct)
                distinct.append(term)
                weights.append(np.zeros((rows, term.size)))
                limits.append(np.full((rows, term.size), -1))
            ticks = term.steps if at_steps else term.states
            if limit is None:
                weights[known[key]][ticks] += term.weight
            else:
                limits[known[key]][ticks] = np.arange(limit.start, limit.stop).reshape(-1, term.size)
        self._weights, whole = np.concatenate(weights, axis=1), np.concatenate(limits, axis=1)
        self._limited = np.flatnonzero((whole >= 0).any(axis=0))
        self._limits = whole[:, self._limited]
        self._lower, self._upper = (np.append(each, 0.0)[self._limits] for each in bounds)
        what = "stack", symbols.tangent.kind, at_steps, static, *(term.key for term in distinct)

        def made_stack() -> tuple[StackSlopes, StageFunctions]:
            made = from_cache(
                lambda: stack_slopes(symbols, [term.value for term in distinct], at_steps, static),
                terms_identity(symbols.rollout, *what),
                (StackSlopes, ReadingFunction),
            )
            return made, StageFunctions([made.function], rows, *evaluated)

        made, self._functions = symbols.rollout.once((what, evaluated), made_stack)
        sizes, self._m = made.sizes, int(symbols.u.shape[0])
        self._cuts = [slice(end - size, end) for size, end in zip(sizes, np.cumsum(sizes).tolist(), strict=True)]
        self._wide, self._shape, self._places = sum(sizes), (rows, *made.shape), made.places
        unused = (self._weights == 0) & (whole < 0)
        self._unused = (unused, unused[:, self._places[0]]) if unused.any() else None

    def add(
        self,
        sums: ExpansionSums,
        x: Array,
        u: Array,
        constants: Array,
        clock: float,
        multipliers: Array,
        penalties: Array,
    ) -> None:
        """Add the terms about a motion.

        Args:
            sums: to add to.
            x: (N + 1, nx) states.
            u: (N, m) inputs of the rollout.
            constants: (1, c) of the terms.
            clock: [steps] the time of the first state.
            multipliers: (c,) of all limits.
            penalties: (c,) likewise.
        """
        # Values r and slopes S of all terms, one row each, at states or at steps.
        steps, at_steps = len(u), self._at_steps
        before, after = (x[:-1], x[1:]) if at_steps else (x, x)
        u = u if at_steps else np.concatenate([u, u[-1:]])
        ((r, packed),) = self._functions(StepRows(before, after, u, constants, np.arange(len(u)), clock))
        if self._unused is not None:  # unused entries may be not finite
            r, packed = r.copy(), packed.copy()
            r[self._unused[0]], packed[self._unused[1]] = 0.0, 0.0
        slopes = np.zeros(self._shape)
        slopes[:, self._places[0], self._places[1]] = packed
        # Limits: shifted violations and the weights of the augmented Lagrangian.
        weights = self._weights
        if len(self._limited):
            r, weights = self._violations(r, multipliers, penalties)
        sums.value += float(np.vdot(weights * r, r))
        # Columns of constants become those of the static entries of z.
        by_statics = slopes.shape[2] > self._wide
        if by_statics:
            slopes = np.concatenate([slopes[:, :, : self._wide], sums.by_constants(slopes[:, :, self._wide :])], axis=2)
        # Gauss-Newton: slope 2 S' w r and curvature 2 S' w S, added to the blocks of the expansion.
        bent = (2 * weights)[:, :, None] * slopes
        slope, curve = (r[:, None] @ bent)[:, 0], slopes.transpose(0, 2, 1) @ bent
        by_x, first, by_u = self._cuts
        here = slice(1, None) if at_steps else slice(None)
        mixed, m = (sums.uy if at_steps else sums.ux), self._m
        sums.x[here] += slope[:, by_x]
        sums.xx[here] += curve[:, by_x, by_x]
        sums.u[:, :m] += slope[:steps, by_u]
        sums.uu[:, :m, :m] += curve[:steps, by_u, by_u]
        mixed[:, :m] += curve[:steps, by_u, by_x]
        n = first.stop - first.start
        if n:
            sums.x[:-1, :n] += slope[:, first]
            sums.xx[:-1, :n, :n] += curve[:, first, first]
            sums.ux[:, :m, :n] += curve[:, by_u, first]
        if by_statics and sums.s.size:
            s = slice(self._wide, None)
            sums.s += slope[:, s].sum(axis=0)
            sums.ss += curve[:, s, s].sum(axis=0)
            sums.sx[here] += curve[:, s, by_x]
            sums.su[:, :, :m] += curve[:steps, s, by_u]
            if n:
                sums.sx[:-1, :, :n] += curve[:, s, first]

    def _violations(self, r: Array, multipliers: Array, penalties: Array) -> tuple[Array, Array]:
        """Return (T, R) values, those of limits as shifted violations, and weights."""
        some, r, weights = self._limited, r.copy(), self._weights.copy()
        multiplier, penalty = (np.append(each, 0.0)[self._limits] for each in (multipliers, penalties))
        moved = r[:, some] + multiplier / np.where(penalty > 0, penalty, 1.0)
        beyond = moved - np.clip(moved, self._lower, self._upper)
        r[:, some] = beyond
        weights[:, some] = penalty * (beyond != 0) / 2
        return r, weights


def square_stacks(
    symbols: StageSymbols,
    terms: Sequence[StageTerm],
    bounds: tuple[Array, Array],
    static: bool,
    evaluated: Evaluated,
) -> list[SquareStack]:
    """Return the stacks of the squares and limits among terms; see ``SquareStack``."""
    at_states, at_steps, places, first = list[StageTerm](), list[StageTerm](), dict[int, slice](), 0
    for term in terms:
        if term.kind == "limit":
            places[id(term)] = slice(first, first + len(term.steps) * term.size)
            first = places[id(term)].stop
    stacked = [term for term in terms if term.kind in ("squares", "limit")]
    identity = terms_identity(symbols.rollout, "sides of terms", [term.key for term in stacked])
    sides = from_cache(lambda: [_of_both_sides(symbols, term) for term in stacked], identity)
    for term, both in zip(stacked, sides, strict=True):
        (at_steps if both else at_states).append(term)
    chosen = ((each, both) for each, both in ((at_states, False), (at_steps, True)) if each)
    return [SquareStack(symbols, each, places, bounds, both, static, evaluated) for each, both in chosen]


def _of_both_sides(symbols: StageSymbols, term: StageTerm) -> bool:
    """Whether a term of the state after a step depends on what leads there, too."""
    if not term.after:
        return False
    whole = ca.Function("term", list(symbols.arguments), [ca.densify(term.value)])
    return any(whole.jac_sparsity(0, i).nnz() for i in (1, 2))


def _padded(slope: ca.SX, columns: int) -> ca.SX:
    """Return a slope, padded to ``columns`` if it has none."""
    return slope if slope.shape[1] == columns else ca.SX(slope.shape[0], columns)
