"""How near a kernel comes to the machine's arithmetic limit, as a figure. Run with ``make bench``.

The operations of a step are counted by kind in the kernel's own functions; how many of each kind this processor can do
in a second is measured by loops of independent ones. A floor is the time that the operations of one kind need alone.
Arithmetic and memory have units of their own and work at the same time, so the larger of the two sums is the limit.
"""

from __future__ import annotations

import ctypes
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from measured_worlds import spheres_on_ground
from spheres import BATCH, COUNT, STEPS, around, fastest, guess_of

from symphys.codegen import Program, compile_program
from symphys.codegen.emit.plan import plan
from symphys.codegen.emit.planned import Plan
from symphys.codegen.graph.operations import MASKS
from symphys.codegen.toolchain.compiler import find_compiler, processor
from symphys.transcription import rollout_program
from symphys.transcription.rollout import symbolic_rollout

LOOPS, CHAINS = 200_000, 12
MEMORY = "load, store"
KINDS = {
    "add, multiply": "x[k] = x[k] * c + c;",
    "compare, select": "x[k] = (V)(((I)(x[k] < c) & (I)x[k]) | (I)c);",
    "divide": "x[k] = c / x[k];",
    "root": "for (int l = 0; l < LANES; l++) x[k][l] = __builtin_sqrt(x[k][l]);",
    MEMORY: 'x[k] = m[k]; __asm__ volatile("" : "+x"(x[k])); m[k + CHAINS] = x[k];',
}
EACH = {"add, multiply": 2, "compare, select": 3, "divide": 1, "root": 1, MEMORY: 2}
"""Operations in each of those."""
CODE = """
#include <stdint.h>
typedef double V __attribute__((vector_size(LANES * 8)));
typedef int64_t I __attribute__((vector_size(LANES * 8)));
static V m[2 * CHAINS];
__attribute__((visibility("default"))) double run(void) {
    V c = (V){0} + 1.0000001, x[CHAINS];
    for (int k = 0; k < CHAINS; k++) x[k] = c + k;
    for (long i = 0; i < LOOPS; i++) {
        __asm__ volatile("" : "+x"(c));
        #pragma GCC unroll 16
        for (int k = 0; k < CHAINS; k++) { BODY }
    }
    double sum = 0;
    for (int k = 0; k < CHAINS; k++) sum += x[k][0];
    return sum;
}
"""


def nanoseconds(kind: str) -> float:
    """For one operation on a whole block of lanes."""
    compiler, lanes = find_compiler(), processor().lanes(False)
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "code.c", Path(folder) / "code.so"
        source.write_text(CODE.replace("BODY", KINDS[kind]), encoding="utf-8")
        sizes = [f"-DLANES={lanes}", f"-DCHAINS={CHAINS}", f"-DLOOPS={LOOPS}L"]
        flags = [*compiler.flags(processor()), "-ffp-contract=off", "-shared"]
        subprocess.run([*compiler.command, *flags, *sizes, str(source), "-o", str(target)], check=True)
        run = ctypes.CDLL(str(target)).run
        return 1e9 * fastest(run) / (LOOPS * CHAINS * EACH[kind])


def kind_of(op: str) -> str | None:
    """The kind of an operation; None for constants."""
    if op in MASKS | {"iez", "select", "one", "fabs", "neg"}:
        return "compare, select"
    names = {"div": "divide", "sqrt": "root", "input": MEMORY, "const": None}
    return names.get(op, "add, multiply")


def operations(planned: Plan, tables: tuple[str, ...]) -> Counter[str]:
    """Operations by kind of one step."""
    total: Counter[str] = Counter()
    each: dict[int, Counter[str]] = {}
    for name in tables:
        rows, table = planned.tables[name]
        at = 0
        for _ in range(rows):
            number, length = int(table[at]), int(table[at + 1])
            if number not in each:
                graph = planned.functions[number][0]
                kinds = [kind_of(graph.nodes[x].op) for x in graph.needed()]
                each[number] = Counter(kind for kind in kinds if kind)
                each[number][MEMORY] += sum(map(len, graph.results))
            total += each[number]
            at += length
    return total


def floors(program: Program, tables: tuple[str, ...], costs: dict[str, float], lanes: int) -> dict[str, float]:
    """Nanoseconds of a step and robot that each kind needs."""
    counts = operations(plan(program, ("merit",)), tables)
    return {kind: counts[kind] * costs[kind] / lanes for kind in KINDS}


def main() -> None:
    """Print the shares, draw the figure into the folder given (default: here)."""
    costs = {kind: nanoseconds(kind) for kind in KINDS}
    print("ns an operation on a block:", {kind: round(cost, 3) for kind, cost in costs.items()})
    problem = spheres_on_ground(COUNT, 10, STEPS)
    program = rollout_program(symbolic_rollout(problem), exact=True)
    kernel = compile_program(program, seeded=("merit",), threads=1)
    Z = around(guess_of(problem))
    seconds = {
        "rollout": fastest(lambda: kernel.forward(Z, [0.0])),
        "with gradient": fastest(lambda: kernel.gradient(Z, [1.0], [0.0])),
    }
    tables = {"rollout": ("body",), "with gradient": ("body", "again", "back_body")}
    figure, axis = plt.subplots(figsize=(8, 3), layout="constrained")
    for row, (what, measured) in enumerate(seconds.items()):
        total = 1e9 * measured / BATCH / STEPS
        parts = floors(program, tables[what], costs, kernel.report.lanes)
        memory = parts.pop(MEMORY)
        arithmetic = sum(parts.values())
        print(
            f"{what}: {total:.0f} ns a step and robot; arithmetic {arithmetic:.0f} ({arithmetic / total:.0%})", end=""
        )
        print(
            f": { ({kind: round(value) for kind, value in parts.items()}) }; memory {memory:.0f} ({memory / total:.0%})"
        )
        ends = np.cumsum([0, *parts.values()])
        for k, (kind, value) in enumerate(parts.items()):
            axis.barh(3 * row, value, left=ends[k], color=f"C{k}", label=kind if row == 0 else None)
        axis.barh(3 * row + 0.8, memory, color="C5", label=MEMORY if row == 0 else None)
        axis.barh(3 * row + 1.6, total, color="0.75", label="measured" if row == 0 else None)
    axis.set(yticks=[0.8, 3.8], yticklabels=list(seconds), xlabel="ns a step and robot; 60 rows, 10 sweeps, exact")
    axis.legend(frameon=False, ncols=3, loc="lower right")
    figure.savefig(Path(sys.argv[1] if len(sys.argv) > 1 else ".") / "limit.svg")


if __name__ == "__main__":
    main()
