"""A plan: the functions to compile, and the tables that the driver walks; a second start reads these from a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import TYPE_CHECKING

import numpy as np

from symphys.codegen.emit.guarding import TABLES, Guarding
from symphys.records import dataclass
from symphys.types import Ints

if TYPE_CHECKING:
    from symphys.codegen.emit.form import Form
    from symphys.codegen.emit.shapes import Shape
    from symphys.codegen.graph.graph import Graph
    from symphys.codegen.program.program import Program


@dataclass(frozen=True)
class Plan:
    """The functions and tables of a program, for the compiler and the driver.

    Attributes:
        functions: the C functions, in the order of their numbers.
        tables: for each phase the number of calls and their entries.
        tape: words after the program's own, for what adjoints need not compute again.
        written: (places, 3) offset, size and stride of what each step of the body writes for itself.
        guarding: of calls that may be left out; None: none may.
        program: what was planned, in the order of its tables; None: as it was given.
        packs: (first call of the body, number of calls) that a library of one lane may compute side by side.
        callers: for each table of ``TABLES`` the calls of the body whose entries it has.
        shapes: of the functions in a library of one lane; empty for blocks of rollouts.
        size: words before the tape; 0: the program's.
        signature: of the plan of a library of one lane, how its C differs from that for blocks.
    """

    functions: tuple[tuple[Graph, Form], ...]
    tables: dict[str, tuple[int, Ints]]
    tape: int
    written: Ints
    guarding: Guarding | None = None
    program: Program | None = None
    packs: tuple[tuple[int, int], ...] = ()
    callers: Mapping[str, Ints] = field(default_factory=dict)
    shapes: tuple[Shape, ...] = ()
    size: int = 0
    signature: str = ""

    def moving(self) -> list[set[int]]:
        """Return for each function which of its places move with the step in any of its calls."""
        found: list[set[int]] = [set() for _ in self.functions]
        order = [*TABLES, *(name for name in self.tables if name not in TABLES)]
        words = np.concatenate([self.tables[name][1] for name in order])
        moves = words != 0
        if self.guarding is not None:
            self.guarding.mark_redirected(moves)
        starts: dict[int, list[int]] = {}
        begin = 0
        for count, table in (self.tables[name] for name in order):
            entries, at = table.tolist(), 0
            for _ in range(count):
                starts.setdefault(entries[at], []).append(begin + at)
                at += entries[at + 1]
            begin += len(table)
        for number, calls in starts.items():
            places = np.arange((words[calls[0] + 1] - 2) // 2)
            strides = moves[np.array(calls)[:, None] + 3 + 2 * places]
            found[number] = set(np.flatnonzero(strides.any(axis=0)).tolist())
        return found
