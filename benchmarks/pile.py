"""Time of a step, compile time and memory of a heap of N spheres, as a figure. Run with ``make bench``."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from time import perf_counter

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from measured_worlds import pile
from spheres import around, fastest, guess_of

from symphys.codegen import Cache, compile_program
from symphys.transcription import rollout_program
from symphys.transcription.rollout import symbolic_rollout

COUNTS = (2, 4, 8, 16, 32, 64)
BATCH, STEPS = 8, 20


def measure(count: int) -> dict[str, float]:
    """Everything about one heap."""
    problem = pile(count, steps=STEPS)
    began = perf_counter()
    rollout = symbolic_rollout(problem)
    program = rollout_program(rollout, exact=True)
    build = perf_counter() - began
    with tempfile.TemporaryDirectory() as folder:
        kernel = compile_program(program, seeded=("merit",), threads=1, cache=Cache(Path(folder)))
    Z = around(guess_of(problem), BATCH)
    forward = fastest(lambda: kernel.forward(Z, [0.0]))
    gradient = fastest(lambda: kernel.gradient(Z, [1.0], [0.0]))
    return {
        "N": count,
        "rows": 3 * len(rollout.world.pairs),
        "forward": 1e6 * forward / BATCH / STEPS,
        "gradient": 1e6 * gradient / BATCH / STEPS,
        "build": build,
        "compile": kernel.report.seconds,
        "memory": kernel.report.bytes_per_lane / 2**20,
    }


def draw(results: list[dict[str, float]], path: Path) -> None:
    """Against the number of candidate rows: time of a step, build and compile time, memory."""
    rows = [r["rows"] for r in results]
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained")
    panels = (
        ("a step [us a robot]", {"rollout": "forward", "with gradient": "gradient"}),
        ("once [s]", {"build": "build", "compile, cold": "compile"}),
        ("memory [MiB a lane]", {"gradient": "memory"}),
    )
    for axis, (title, curves) in zip(axes, panels, strict=True):
        for label, key in curves.items():
            axis.loglog(rows, [r[key] for r in results], "o-", label=label)
        axis.set(xlabel="candidate rows", ylabel=title)
        axis.minorticks_off()
        axis.grid(alpha=0.3)
        axis.legend(frameon=False)
    figure.savefig(path)


def main() -> None:
    """Print the table, draw the figure into the folder given (default: here)."""
    results = []
    for count in COUNTS:
        results.append(measure(count))
        print({key: round(value, 2) for key, value in results[-1].items()}, flush=True)
    draw(results, Path(sys.argv[1] if len(sys.argv) > 1 else ".") / "pile.svg")


if __name__ == "__main__":
    main()
