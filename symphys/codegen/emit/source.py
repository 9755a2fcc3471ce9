"""The C files of a plan: functions spread over several, so that they compile in parallel, and the driver."""

from __future__ import annotations

from collections.abc import Sequence

from symphys.codegen.emit.dialect import ONE_LANE, PACK, VECTORS, Dialect
from symphys.codegen.emit.planned import Plan
from symphys.codegen.emit.writer import write
from symphys.codegen.toolchain.source_file import SourceFile, resource

DRIVER = ("program.h", "guards.c", "driver.c")
NUMBERS = "#define NUMBERS\n"
UNALIGNED = "typedef V U __attribute__((aligned(sizeof(R)), may_alias));\n"
MAX_FILES, NODES_PER_FILE = 4, 400
"""Most files of values and most of adjoints; nodes for which another file is begun."""


def sources(plan: Plan, lanes: int, single: bool, narrow: bool = False) -> list[SourceFile]:
    """Return the C files; each compiles alone. Values have no fused products, so that they are casadi's to the bit.

    ``narrow``: of fewer lanes than a vector register has.
    """
    found, moving = [], plan.moving()
    shapes = plan.shapes or [None] * len(plan.functions)
    kinds: dict[tuple[bool, int], list[int]] = {}
    for i, ((_, form), shape) in enumerate(zip(plan.functions, shapes, strict=True)):
        kinds.setdefault((form.backward, shape.lanes if shape else 1), []).append(i)
    for (_, calls), mine in sorted(kinds.items()):
        work = [len(plan.functions[i][0]) for i in mine]
        dialect = PACK if calls > 1 else forms_of(lanes)
        texts = [write(f"f{i}", *plan.functions[i], dialect, moving[i], shapes[i]) for i in mine]
        start = pack_head(calls, single) if calls > 1 else head_of(lanes, single, dialect)
        for group in spread(texts, work, MAX_FILES):
            found.append(SourceFile("\n".join([start, *group]), narrow=narrow, straight=True))
    driver = head_of(lanes, single) + listed(len(plan.functions)) + "".join(map(resource, (*DRIVER, "phases.c")))
    return [*found, SourceFile(driver)]


def listed(count: int, dialect: Dialect = VECTORS) -> str:
    """Return the functions f0, f1 .. in C, by number, as a driver calls them."""
    names = [f"f{number}" for number in range(count)]
    declared = "".join(f"void {name}(V *m, V *b, {dialect.table}t, word k);\n" for name in names)
    table = ", ".join(names) or "0"
    return f"{declared}static void (*const FUNCTIONS[])(V *, V *, {dialect.table}, word) = {{{table}}};\n"


def head_of(lanes: int, single: bool, dialect: Dialect = VECTORS) -> str:
    """Return the head of a C file."""
    head = f"#define LANES {lanes}\n#define SINGLE {int(single)}\n"
    return head + (NUMBERS if dialect is ONE_LANE else "") + resource("vector.h")


def pack_head(calls: int, single: bool) -> str:
    """Return the head of a C file of functions for several calls at once."""
    each = ", ".join(["x_"] * calls)
    whole = f"#define ALL(x) ({{ const R x_ = (x); (V){{{each}}}; }})\n"
    return head_of(calls, single) + whole + UNALIGNED


def forms_of(lanes: int) -> Dialect:
    """Return the dialect of functions for blocks of lanes; one lane is plain numbers."""
    return ONE_LANE if lanes == 1 else VECTORS


def spread(texts: Sequence[str], work: Sequence[int], most: int) -> list[list[str]]:
    """Split items into at most ``count`` groups of similar work: the largest first, each to the least loaded group."""
    count = max(1, min(most, len(texts), sum(work) // NODES_PER_FILE))
    groups: list[list[str]] = [[] for _ in range(count)]
    loads = [0] * count
    for i in sorted(range(len(texts)), key=lambda i: -work[i]):
        least = loads.index(min(loads))
        groups[least].append(texts[i])
        loads[least] += work[i]
    return [group for group in groups if group]
