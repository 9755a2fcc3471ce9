"""Quantities over time of many rollouts of different lengths, and their exact derivatives along some directions.

Forward mode: a lane carries a rollout and its derivatives along ``DIRECTIONS_PER_LANE`` directions. For few numbers
that set a whole motion this costs about one rollout for each direction; adjoints cost a few for each output number.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np

from symphys.codegen import Kernel, Program, compile_program, processors
from symphys.codegen.program.tangent import tangent_name, tangent_program
from symphys.expression import Formula
from symphys.transcription.program import NO_FORMULAS, rollout_program
from symphys.transcription.rollout import Rollout
from symphys.types import Array

DIRECTIONS_PER_LANE = 4
"""Directions in a lane. With one, 25 directions of a cube's toss took 36 rollouts; with 4, 23; with 8, 24."""
MAX_ROWS_PER_CALL = 128
"""Rollouts, or groups of directions of them, in a call, which bounds the memory of its arrays."""


class QuantitySlopes:
    """Kernels for the values of formulas at the start of every step, and for their derivatives.

    Attributes:
        rollout: of a problem.
        names, watched: of the formulas, and of those that have values alone.
        sizes: by the name of a formula, how many numbers it has.
        steps: of the longest rollout.
    """

    def __init__(
        self,
        rollout: Rollout,
        formulas: Mapping[str, Formula],
        smoothing: float = 0.0,
        threads: int | None = None,
        by_step: Sequence[str] = (),
        watched: Mapping[str, Formula] = NO_FORMULAS,
    ) -> None:
        """Prepare the kernels, compiled at the first call, which raises KernelUnavailable without a compiler.

        ``by_step``: see ``rollout_program``.
        """
        self.rollout, self.smoothing, self.steps = rollout, smoothing, rollout.steps
        self._threads = processors() if threads is None else threads
        both = {**watched, **formulas}
        self._program = rollout_program(rollout, smoothing == 0, both, 0, by_step)
        self.names, self.watched = tuple(formulas), tuple(watched)
        self.sizes = {name: self._program.outputs[name].size // self.steps for name in both}

    def values(self, Z: Array, lasts: Sequence[int], names: Sequence[str] | None = None) -> Iterator[Array]:
        """Yield for each row of Z (B, n) the quantities (last + 1, m), side by side, at the starts of steps 0 .. last.

        ``names``: of some of them, or of those that are watched; by default all but these.
        """
        names = self.names if names is None else names
        for rows, skipped in self._calls(lasts, 1):
            found = self._values.forward(Z[rows], (self.smoothing,), skipped)
            yield from self._rows(found, names, [lasts[row] + 1 for row in rows], 1)

    def slopes(self, Z: Array, directions: Array, lasts: Sequence[int]) -> Iterator[tuple[Array, Array]]:
        """Yield the quantities (last + 1, m) of each row and their derivatives (last + 1, m, d).

        ``directions``: (B, n, d) how the numbers of each row of Z change.
        """
        count, n, d = directions.shape
        groups = -(-d // DIRECTIONS_PER_LANE)
        padded = np.zeros((count, n, groups * DIRECTIONS_PER_LANE))
        padded[:, :, :d] = directions
        seeds = padded.reshape(count, n, groups, DIRECTIONS_PER_LANE).transpose(0, 2, 1, 3).reshape(count, groups, -1)
        names = tuple(map(tangent_name, self.names))
        for rows, skipped in self._calls(lasts, groups):
            given = seeds[rows].reshape(len(rows) * groups, -1)
            parameters = np.column_stack([np.full(len(given), self.smoothing), given])
            found = self._slopes.forward(np.repeat(Z[rows], groups, axis=0), parameters, skipped)
            lengths = [lasts[row] + 1 for row in rows]
            first = {name: block[::groups] for name, block in found.items()}
            values = self._rows(first, self.names, lengths, 1)
            lanes = self._rows(found, names, np.repeat(lengths, groups).tolist(), DIRECTIONS_PER_LANE)
            for value in values:
                along = [next(lanes).reshape(*value.shape, DIRECTIONS_PER_LANE) for _ in range(groups)]
                yield value, np.concatenate(along, axis=2)[:, :, :d]

    def _calls(self, lasts: Sequence[int], groups: int) -> Iterator[tuple[list[int], int]]:
        """Yield rows that are computed in one call, in order, and how many steps none of them needs."""
        together = max(1, MAX_ROWS_PER_CALL // groups)
        for first in range(0, len(lasts), together):
            rows = list(range(first, min(first + together, len(lasts))))
            yield rows, self.steps - 1 - max(lasts[row] for row in rows)

    def _rows(
        self, found: Mapping[str, Array], names: Sequence[str], lengths: Sequence[int], width: int
    ) -> Iterator[Array]:
        """Return (length, numbers) for each row: the named outputs side by side."""
        for row, length in enumerate(lengths):
            parts = [found[name][row].reshape(self.steps, -1)[:length] for name in names]
            yield np.concatenate([part.reshape(length, -1, width) for part in parts], axis=1).reshape(length, -1)

    @cached_property
    def _values(self) -> Kernel:
        return self._compiled(self._program)

    @cached_property
    def _slopes(self) -> Kernel:
        return self._compiled(tangent_program(self._program, DIRECTIONS_PER_LANE, self.names))

    def _compiled(self, program: Program) -> Kernel:
        return compile_program(program, seeded=(), threads=self._threads)
