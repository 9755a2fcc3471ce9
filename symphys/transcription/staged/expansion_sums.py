"""The augmented objective to second order, summed term by term over nonzero entries only."""

from __future__ import annotations

import numpy as np

from symphys.shooting import Expansion
from symphys.transcription.staged.stage_terms import StageTerm
from symphys.transcription.staged.term_slopes import Block, Blocks
from symphys.types import Array, Ints


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
            knots: which of the constants are knots of controls (k,), and the step and input of each (k, 2).
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
