"""The C files of a plan: functions spread over several, so that they compile in parallel, and the driver."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files

from symphys.kernel.graph import Graph
from symphys.kernel.plan import Plan
from symphys.kernel.writer import Form, write

ROOM = "symphys.kernel"
FILES = 4
"""Most files of functions; a file is opened for some 400 nodes."""


def sources(plan: Plan, lanes: int, single: bool) -> list[str]:
    """The text of each C file; each compiles alone."""
    head = f"#define LANES {lanes}\n#define SINGLE {int(single)}\n{_resource('vector.h')}"
    texts = [write(f"f{number}", graph, form) for number, (graph, form) in enumerate(plan.functions)]
    names = [f"f{number}" for number in range(len(texts))]
    declared = "".join(f"void {name}(V *m, V *b, const word *t, word k);\n" for name in names)
    table = ", ".join(names) or "0"
    listed = f"{declared}static void (*const FUNCTIONS[])(V *, V *, const word *, word) = {{{table}}};\n"
    return [
        *("\n".join([head, *group]) for group in _spread(texts, plan.functions)),
        head + listed + _resource("driver.c"),
    ]


def _spread(texts: Sequence[str], functions: Sequence[tuple[Graph, Form]]) -> list[list[str]]:
    """Groups of about equal work: the largest first, each to the group with the least so far."""
    work = [len(graph.nodes) for graph, _ in functions]
    count = max(1, min(FILES, len(texts), sum(work) // 400))
    groups: list[list[str]] = [[] for _ in range(count)]
    loads = [0] * count
    for i in sorted(range(len(texts)), key=lambda i: -work[i]):
        least = loads.index(min(loads))
        groups[least].append(texts[i])
        loads[least] += work[i]
    return [group for group in groups if group]


def _resource(name: str) -> str:
    return files(ROOM).joinpath(name).read_text(encoding="utf-8")
