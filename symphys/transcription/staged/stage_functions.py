"""Functions of one step for many steps at once, of the few numbers that they read: compiled or interpreted."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from symphys.codegen import (
    FunctionCall,
    Kernel,
    KernelUnavailable,
    MemoryLayout,
    Place,
    Program,
    ProgramError,
)
from symphys.codegen.backends import PRECISIONS
from symphys.codegen.toolchain.identity import identity_of
from symphys.codegen.toolchain.warm_start import ProgramSource, compile_source
from symphys.records import dataclass
from symphys.types import Array, Expr, Ints


class ByColumns:
    """A casadi function of columns for any number of them, cached by that number."""

    def __init__(self, function: ca.Function) -> None:
        """Wrap a function, which is built at the first call."""
        self.function = function
        self._mapped: dict[int, ca.Function] = {}

    def __call__(self, *columns: Any) -> list[Array]:
        """Evaluate arguments (size, T) -> results (rows, T * columns)."""
        count = int(columns[0].shape[1])
        if count not in self._mapped:
            self._mapped[count] = self.function.map(count)
        return [np.array(result, float) for result in self._mapped[count].call(list(columns))]


MIN_COMPILED_OPERATIONS = 30_000
"""Operations of a horizon from which compiling pays; the virtual machine does as many in 0.2 ms."""


class StepRows(NamedTuple):
    """Arguments of many steps, one row each.

    Attributes:
        before, after: (R, nx) the states before and after it.
        u: (R, m).
        constants: (R, c) or (1, c).
        ticks: (R,) numbers of the states before.
        clock: [steps] the time at which state 0 is, for formulas that name the time.
    """

    before: Array
    after: Array
    u: Array
    constants: Array
    ticks: Ints
    clock: float = 0.0


@dataclass(frozen=True, eq=False)
class ReadingFunction:
    """A function of those entries of its arguments that it reads.

    Attributes:
        function: (entries of each argument) -> columns.
        reads: the entries of each argument.
        after: whether the first argument is the state after the step, and the last the number of that.
    """

    function: ca.Function
    reads: tuple[tuple[int, ...], ...]
    after: bool

    @property
    def segments(self) -> list[tuple[str, tuple[int, ...]]]:
        """Return the entries that the function reads of each field of ``StepRows``."""
        state, tick = ("after", "next") if self.after else ("before", "ticks")
        return [*zip((state, "before", "u", "constants", tick), self.reads, strict=True)]


def reading(results: Sequence[Expr], arguments: Sequence[Expr], after: bool) -> ReadingFunction:
    """Return results as a function of the entries that they read."""
    whole = ca.Function("whole", list(arguments), [ca.densify(ca.vec(each)) for each in ca.cse(list(results))])
    reads = []
    for i in range(whole.n_in()):
        columns = [whole.jac_sparsity(o, i).get_triplet()[1] for o in range(whole.n_out())]
        reads.append(tuple(sorted(set().union(*columns))))
    symbols = [ca.SX.sym("a", len(each)) for each in reads]
    full = []
    for symbol, each, argument in zip(symbols, reads, arguments, strict=True):
        column = ca.SX.zeros(argument.shape[0])
        if each:
            column[list(each)] = symbol
        full.append(column)
    found = whole.call(full, True, False)
    return ReadingFunction(ca.Function("stage", symbols, [ca.densify(each) for each in found]), tuple(reads), after)


class StageFunctions:
    """Functions at the same steps, all in one kernel whose lanes are steps.

    What is small stays on casadi's virtual machine, as does everything where no compiler is found.
    """

    def __init__(
        self,
        functions: Sequence[ReadingFunction],
        steps: int,
        backend: str,
        threads: int | None,
        worth: int | None = None,
    ) -> None:
        """Collect functions; they are compiled on demand.

        Args:
            functions: to evaluate together.
            steps: of a horizon.
            backend: a name of a kernel, or another for casadi's virtual machine.
            threads: their number for the steps; None: one for each processor.
            worth: operations of a horizon above which they are compiled, and waited for; None:
                ``MIN_COMPILED_OPERATIONS``, and until they are an interpreter evaluates.
        """
        self.functions, self.backend, self.threads = list(functions), backend, threads
        keys = dict.fromkeys(segment for each in self.functions for segment in each.segments)
        order = ("before", "after", "u", "constants", "ticks", "next")
        self._segments = sorted((key for key in keys if key[1]), key=lambda key: order.index(key[0]))
        work = sum(each.function.n_instructions() for each in self.functions)
        self._waits = worth is not None
        self._compiles = backend in PRECISIONS and work * steps > (MIN_COMPILED_OPERATIONS if worth is None else worth)
        self._gathered = {name: self._entries(name) for name in order}
        sizes = [int(each.function.numel_out(o)) for each in self.functions for o in range(each.function.n_out())]
        self._ends = np.cumsum([0, *sizes])

    def __call__(self, rows: StepRows) -> list[list[Array]]:
        """Return the results of each function, (R, size) each."""
        table = self._table(rows)
        if self._kernel is None:
            found = [part.T for part in self._columns(np.ascontiguousarray(table.T))] if len(table) else []
            whole = found[0] if found else np.zeros((0, int(self._ends[-1])))
        else:
            whole = self._kernel.forward(table)["all"]
        parts, results = iter(zip(self._ends[:-1], self._ends[1:], strict=True)), []
        for each in self.functions:
            results.append([whole[:, slice(*next(parts))] for _ in range(each.function.n_out())])
        return results

    def _entries(self, name: str) -> Ints:
        return np.array([i for source, each in self._segments if source == name for i in each], np.int64)

    def _table(self, rows: StepRows) -> Array:
        """Return (R, w): all segments side by side."""
        count, parts = len(rows.ticks), []
        for name in ("before", "after", "u", "constants"):
            entries = self._gathered[name]
            if len(entries):
                part = np.take(getattr(rows, name), entries, axis=1)
                parts.append(part if len(part) == count else np.broadcast_to(part, (count, part.shape[1])))
        for name, more in (("ticks", 0), ("next", 1)):
            if len(self._gathered[name]):
                parts.append((rows.ticks + (rows.clock + more))[:, None])
        return np.concatenate([np.zeros((count, 0)), *parts], axis=1)

    @cached_property
    def _program(self) -> Program:
        layout, places = MemoryLayout(), dict[tuple[str, tuple[int, ...]], Place]()
        nothing = Place(0, 0)
        for key in self._segments:
            places[key] = layout.take(len(key[1]))
        size, calls = layout.size, []
        for each in self.functions:
            inputs = tuple(places.get(key, nothing) for key in each.segments)
            results = tuple(layout.take(int(each.function.numel_out(o))) for o in range(each.function.n_out()))
            calls.append(FunctionCall(each.function, inputs, results))
        outputs = {"all": Place(size, int(self._ends[-1]))}
        return Program(layout.size, Place(0, size), nothing, 1, outputs, epilogue=tuple(calls))

    @cached_property
    def _kernel(self) -> Kernel | None:
        if not self._compiles:
            return None
        try:
            own = [(each.function.serialize(), each.segments) for each in self.functions]
            source = ProgramSource(lambda: self._program, identity_of("stage functions", own))
            return compile_source(source, (), self.threads, wait=self._waits)
        except (KernelUnavailable, ProgramError):
            return None  # the step's description says why there is no compiler

    @cached_property
    def _columns(self) -> ByColumns:
        symbols = {key: ca.SX.sym("segment", len(key[1])) for key in self._segments}
        results = []
        for each in self.functions:
            arguments = [symbols.get(key, ca.SX(0, 1)) for key in each.segments]
            results += each.function.call(arguments, True, False)
        row = ca.vertcat(ca.SX(0, 1), *symbols.values())
        return ByColumns(ca.Function("rows", [row], [ca.densify(ca.vertcat(ca.SX(0, 1), *results))]))
