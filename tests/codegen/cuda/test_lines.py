"""Statements of a device: loads ahead of what uses them, and sums that are kept only where no other place is met."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from worlds import programs

from symphys.codegen.cuda.kernel import results_apart
from symphys.codegen.emit.plan import FAST_MEMORY, plan
from symphys.codegen.emit.writer import Lines


def told(ahead: int) -> list[str]:
    """Three loads, each with its use, and two sums in one word."""
    lines = Lines(ahead)
    for k in range(3):
        lines.load(f"load {k}")
        lines.compute(f"use {k}")
        lines.store(f"store {k}")
    lines.add("o", "1")
    lines.add("o", "2")
    return lines.all()


def test_statements_stay_where_they_are() -> None:
    sums = ["V s0 = o;", "s0 += 1;", "o = s0;", "V s1 = o;", "s1 += 2;", "o = s1;"]
    assert told(0) == [*(f"{what} {k}" for k in range(3) for what in ("load", "use", "store")), *sums]


def test_loads_of_a_group_come_first_and_its_stores_last() -> None:
    assert told(9) == [
        *("load 0", "load 1", "load 2", "V s0 = o;"),
        *("use 0", "use 1", "use 2", "s0 += 1;", "s0 += 2;"),
        *("store 0", "store 1", "store 2", "o = s0;"),
    ]
    two = told(2)
    assert two[:4] == ["load 0", "load 1", "use 0", "store 0"]
    assert two.index("o = s0;") < two.index("V s1 = o;")


def test_results_that_meet_in_some_call_are_found() -> None:
    """What is squared is given twice, so that its adjoint is added to twice."""
    program = programs.chain()
    planned = plan(program, ["merit", "work"], FAST_MEMORY, noted=False)
    apart = results_apart(planned, program.steps)
    met = [
        [len(result) for result in graph.results]
        for (graph, form), own in zip(planned.functions, apart, strict=True)
        if form.adds and len(own) < len(graph.results)
    ]
    assert met == [[1, 1]]


def test_places_that_meet_in_a_later_step_count() -> None:
    """The second result of the adjoint of ``visit`` is given another stride, with which it comes to the first."""
    program = programs.chain()
    planned = plan(program, ["merit"], FAST_MEMORY, noted=False)
    number = max(range(len(planned.functions)), key=lambda n: len(planned.functions[n][0].results))
    graph, form = planned.functions[number]
    assert form.backward and results_apart(planned, program.steps)[number] == set(range(len(graph.results)))
    count, table = planned.tables["back_body"]
    moved, at = table.copy(), 0
    while moved[at] != number:
        at += moved[at + 1]
    first = moved[at + 2 + 2 * len(graph.sizes) :]
    first[2:4] = first[0] + 10 * (first[1] + 1), -1
    first[1] = 0
    changed = replace(planned, tables={**planned.tables, "back_body": (count, moved)})
    assert np.any(table != moved)
    for steps, wanted in ((2, set(range(len(graph.results)))), (30, set(range(2, len(graph.results))))):
        assert results_apart(changed, steps)[number] == wanted
