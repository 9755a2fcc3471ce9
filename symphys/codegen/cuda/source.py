"""The CUDA C++ of a program: the same functions as on a processor, one robot in a thread, and the driver.

Functions are spread over several texts that are linked later: a compiler's time grows far faster than its text.
"""

from __future__ import annotations

from importlib.resources import files

from symphys.codegen.cuda.apart import results_apart
from symphys.codegen.emit import source
from symphys.codegen.emit.dialect import DEVICE
from symphys.codegen.emit.planned import Plan
from symphys.codegen.emit.writer import write

ROOM = "symphys.codegen.cuda"
FILES = 24
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
    return [*("\n".join([head, *group]) for group in source.spread(texts, work, FILES)), driver]


def resource(name: str) -> str:
    """The text of a file of this room."""
    return files(ROOM).joinpath(name).read_text(encoding="utf-8")
