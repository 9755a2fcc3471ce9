"""Statements of a device: loads ahead of what uses them, and sums that are kept only where no other place is met."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np
from worlds import programs

from symphys.codegen.cuda.kernel import results_apart
from symphys.codegen.emit.dialect import DEVICE
from symphys.codegen.emit.form import Form
from symphys.codegen.emit.plan import FAST_MEMORY, plan
from symphys.codegen.emit.writer import write
from symphys.codegen.graph.instructions import graph_of


def told(ahead: int) -> list[str]:
    """Three sines, each added to a word: of these the first two are one."""
    x = ca.SX.sym("x", 3)
    graph = graph_of(ca.Function("f", [x], [ca.sin(x[0]) + 1, ca.sin(x[1]), ca.sin(x[2])]))
    form = Form(primal=1, adds=True)
    text = write("f", graph, form, replace(DEVICE, ahead=ahead), apart=(0, 1))
    return [line.strip() for line in text.split("}")[0].splitlines()[2:] if line.strip()]


def kinds(lines: Sequence[str]) -> str:
    """Tell a load, what is computed, a sum that is kept, and what is stored."""
    return "".join("l" if "i0[" in x or "= o" in x else "s" if x.startswith("o") else "c" for x in lines)


def test_statements_stay_where_they_are() -> None:
    assert kinds(told(0)) == "lcclcs" + "lclcs" + "lcs"


def test_loads_of_a_group_come_first_and_its_stores_last() -> None:
    assert kinds(told(9)) == "lllll" + "cccccc" + "sss"
    assert kinds(told(2)) == "ll" + "ccc" + "s" + "ll" + "cc" + "s" + "l" + "c" + "s"


def test_results_that_meet_in_some_call_are_found() -> None:
    """What is squared is given twice, so that its adjoint is added to twice."""
    program = programs.chain()
    planned = plan(program, ["merit", "work"], FAST_MEMORY, noted=False)
    apart = results_apart(planned, program.steps)
    met = [
        [*graph.result_sizes]
        for (graph, form), own in zip(planned.functions, apart, strict=True)
        if form.adds and len(own) < len(graph.result_sizes)
    ]
    assert met == [[1, 1]]


def test_places_that_meet_in_a_later_step_count() -> None:
    """The second result of the adjoint of ``visit`` is given another stride, with which it comes to the first."""
    program = programs.chain()
    planned = plan(program, ["merit"], FAST_MEMORY, noted=False)
    number = max(range(len(planned.functions)), key=lambda n: len(planned.functions[n][0].result_sizes))
    graph, form = planned.functions[number]
    assert form.backward and results_apart(planned, program.steps)[number] == set(range(len(graph.result_sizes)))
    count, table = planned.tables["back_body"]
    moved, at = table.copy(), 0
    while moved[at] != number:
        at += moved[at + 1]
    first = moved[at + 2 + 2 * len(graph.sizes) :]
    first[2:4] = first[0] + 10 * (first[1] + 1), -1
    first[1] = 0
    changed = replace(planned, tables={**planned.tables, "back_body": (count, moved)})
    assert np.any(table != moved)
    for steps, wanted in ((2, set(range(len(graph.result_sizes)))), (30, set(range(2, len(graph.result_sizes))))):
        assert results_apart(changed, steps)[number] == wanted
