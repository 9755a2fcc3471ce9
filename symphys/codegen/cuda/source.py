"""The CUDA C++ of a program: the same functions as on a processor, one robot in a thread, and the driver.

Functions are spread over several texts that are linked later: a compiler's time grows far faster than its text.
"""

from __future__ import annotations

from importlib.resources import files

import numpy as np

from symphys.codegen.emit import source
from symphys.codegen.emit.dialect import DEVICE
from symphys.codegen.emit.planned import Plan
from symphys.codegen.emit.writer import write
from symphys.types import Ints


def results_apart(planned: Plan, steps: int) -> list[set[int]]:
    """Return the choice for each function; everything for a function without calls."""
    calls: list[list[Ints]] = [[] for _ in planned.functions]
    for count, table in planned.tables.values():
        at = 0
        for _ in range(count):
            calls[int(table[at])].append(table[at + 2 : at + table[at + 1]].reshape(-1, 2))
            at += int(table[at + 1])
    found = []
    for (graph, _), own in zip(planned.functions, calls, strict=True):
        met: set[int] = set()
        sizes = [len(result) for result in graph.results]
        places = np.array([call[len(graph.sizes) :] for call in own]).reshape(len(own), len(sizes), 2)
        for a, b in zip(*np.triu_indices(len(sizes), 1), strict=True):
            if sizes[a] and sizes[b] and _meet(places[:, a], sizes[a], places[:, b], sizes[b], steps):
                met |= {int(a), int(b)}
        found.append(set(range(len(sizes))) - met)
    return found


def _meet(a: Ints, size: int, b: Ints, other: int, steps: int) -> bool:
    """Whether places, (calls, 2) offsets and strides, have a word in common in any step of any call."""
    offset, stride = (b - a).T
    ends = [offset, offset + stride * (steps - 1)]
    least, most = np.minimum(*ends), np.maximum(*ends)  # of the distance, over time: what lies between counts as met
    return bool(((least < size) & (most > -other)).any())


ROOM = "symphys.codegen.cuda"
MAX_FILES = 24
SIGNATURE = "(V *m, V *b, const word *t, word k)"


def device_sources(planned: Plan, steps: int, lanes: int, warps: int, single: bool) -> list[str]:
    """The texts of a plan's kernels, for blocks of so many robots and warps; the last one is the driver's."""
    head = f"#define LANES {lanes}\n#define WARPS {warps}\n#define SINGLE {int(single)}\n{resource('device.h')}"
    apart = results_apart(planned, steps)
    texts = [
        write(f"f{number}", graph, form, DEVICE, apart=apart[number] if form.adds else ())
        for number, (graph, form) in enumerate(planned.functions)
    ]
    work = [len(graph.nodes) for graph, _ in planned.functions]
    names = [f"f{number}" for number in range(len(texts))]
    declared = "".join(f"{DEVICE.entry} {name}{SIGNATURE};\n" for name in names)
    cases = "".join(f"    case {number}: {name}(m, b, t, k); break;\n" for number, name in enumerate(names))
    call = (
        "static __device__ __forceinline__ void call(word number, V *m, V *b, const word *t, word k) {\n"
        f"  switch (number) {{\n{cases}  }}\n}}\n"
    )
    driver = "\n".join([head, declared, call, source.resource("program.h"), resource("driver.cu")])
    return [*("\n".join([head, *group]) for group in source.spread(texts, work, MAX_FILES)), driver]


def resource(name: str) -> str:
    """The text of a file of this room."""
    return files(ROOM).joinpath(name).read_text(encoding="utf-8")
