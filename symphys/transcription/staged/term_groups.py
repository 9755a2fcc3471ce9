"""The terms of a problem along its motions: those of the same steps are evaluated together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from symphys.transcription.rollout import Rollout
from symphys.transcription.staged.stage_functions import ReadingFunction, StageFunctions, StepRows, reading
from symphys.transcription.staged.stage_terms import StageSymbols, StageTerm, motion_sums, stage_terms
from symphys.transcription.staged.tangent import Tangent
from symphys.transcription.staged.term_slopes import TermSlopes, raw_slopes, term_slopes
from symphys.types import Array

MOTIONS = 8
"""Whose values are asked for at once, as a line search does with its step lengths."""


class _Group(NamedTuple):
    """Numbers of terms that are evaluated at the same steps, and whether these are sums."""

    numbers: list[int]
    sums: bool


class TermGroups:
    """All terms, and their values and slopes at their steps.

    Attributes:
        symbols: that they are expressions of.
        terms: costs, targets and constraints in the problem's order, then sums.
    """

    def __init__(self, rollout: Rollout, tangent: Tangent, backend: str, threads: int | None) -> None:
        """Find them; nothing is compiled before it is asked for."""
        self.symbols = StageSymbols(rollout, tangent, motion_sums(rollout))
        self.terms = stage_terms(self.symbols)
        self._backend, self._threads = backend, threads
        groups: dict[tuple[bytes, bool], list[int]] = {}
        for number, term in enumerate(self.terms):
            groups.setdefault((term.steps.tobytes(), term.kind == "sum"), []).append(number)
        self._groups = [_Group(numbers, sums) for (_, sums), numbers in groups.items()]

    def values(self, X: Array, U: Array, constants: Array) -> list[tuple[StageTerm, Array]]:
        """(B, N + 1, nx), (B, N, m), (B, c) -> (B, T, r) of each term but sums, in order."""
        found: dict[int, Array] = {}
        for group, functions in zip(self._groups, self._values, strict=True):
            if group.sums:
                continue
            steps, batch = self.terms[group.numbers[0]].steps, len(X)
            parts = (X[:, steps], X[:, steps + 1], U[:, steps])
            before, after, u = (part.reshape(batch * len(steps), part.shape[2]) for part in parts)
            shared, ticks = np.repeat(constants, len(steps), axis=0), np.tile(steps, batch)
            rows = StepRows(before, after, u, shared, ticks)
            for number, (value,) in zip(group.numbers, functions(rows), strict=True):
                found[number] = value.reshape(batch, len(steps), value.shape[1])
        return [(self.terms[number], found[number]) for number in sorted(found)]

    def summed(self, rows: StepRows) -> Array:
        """(R, nx): the states after steps, whose sums are still those before, with what the steps add."""
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

    def slopes(self, rows: StepRows, sums: bool) -> Iterator[tuple[StageTerm, TermSlopes, list[Array]]]:
        """Of sums, or of all other terms in order: what ``TermSlopes`` makes values and slopes of; a row a step."""
        found: dict[int, list[Array]] = {}
        for group, functions in zip(self._groups, self._slope_functions, strict=True):
            if group.sums == sums:
                here = _rows(rows, self.terms[group.numbers[0]].steps)
                found.update(zip(group.numbers, functions(here), strict=True))
        return ((self.terms[number], self._slopes[number], found[number]) for number in sorted(found))

    def beside(self, term: StageTerm, rows: StepRows) -> Array:
        """(r, nx) the slopes of a term in step 0 by the state before it, number by number."""
        key = id(term)
        if key not in self._beside:
            self._beside[key] = StageFunctions([raw_slopes(self.symbols, term)], 1, "casadi", 1)
        ((x, first),) = self._beside[key](_rows(rows, np.array([0])))
        found = first if term.after else x
        return found.reshape(term.size, -1)[:, : self.symbols.state_size]

    @cached_property
    def _beside(self) -> dict[int, StageFunctions]:
        return {}

    @cached_property
    def _values(self) -> list[StageFunctions]:
        known: dict[Any, ReadingFunction] = {}
        functions = []
        for term in self.terms:
            made = known.setdefault(term.key, reading([term.value], self.symbols.arguments, term.after))
            functions.append(ReadingFunction(made.function, made.reads, term.after))
        return self._grouped(functions, MOTIONS)

    @cached_property
    def _slopes(self) -> list[TermSlopes]:
        known: dict[Any, TermSlopes] = {}
        return [term_slopes(self.symbols, term, known) for term in self.terms]

    @cached_property
    def _slope_functions(self) -> list[StageFunctions]:
        return self._grouped([each.function for each in self._slopes], 1)

    def _grouped(self, functions: Sequence[ReadingFunction], motions: int) -> list[StageFunctions]:
        """Those of each group together, for so many motions at once."""
        made = []
        for group in self._groups:
            steps = motions * len(self.terms[group.numbers[0]].steps)
            made.append(StageFunctions([functions[i] for i in group.numbers], steps, self._backend, self._threads))
        return made


def _rows(rows: StepRows, here: Any) -> StepRows:
    """Some of them."""
    constants = rows.constants if len(rows.constants) == 1 else rows.constants[here]
    return StepRows(rows.before[here], rows.after[here], rows.u[here], constants, rows.ticks[here])
