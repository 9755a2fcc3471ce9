"""What a gradient costs, against the number of weights: the table robot with nets of 10^2 to 10^6 weights.

    python benchmarks/weights.py [folder for the figure]

For one robot and for 128: seconds for 200 steps without and with the gradient with respect to all weights. Nets up to
the size at which they leave the compiled step are in it, larger ones beside it.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import subprocess
import sys
from functools import partial
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from table_robot import calls, fastest, table_problem

from symphys.transcription.network_rollout import partition as split

STEPS = 200
HIDDEN = ([1], [4], [12], [], [40], [100], [256], [256, 256], [512, 512], [1024, 1024])
ROBOTS = (1, 128)


def measure(hidden: list[int]) -> None:
    """Print the number of weights, whether the net is large, and seconds without and with gradient by robots."""
    problem = table_problem(hidden, STEPS)
    both = calls(problem)
    numbers = [fastest(partial(call, robots), 3)[0] for robots in ROBOTS for call in both]
    print(problem.variables[0].guess.size, int(split.has_large_nets(problem)), *numbers, flush=True)


def main(folder: Path) -> None:
    """Measure each net in a process of its own, and draw."""
    rows = []
    print("weights  beside  seconds: 1 robot, with gradient, 128 robots, with gradient")
    for k in range(len(HIDDEN)):
        told = subprocess.run([sys.executable, __file__, str(k)], check=True, capture_output=True, text=True).stdout
        print(told, end="", flush=True)
        rows.append([float(word) for word in told.split()])
    draw(np.array(sorted(rows)), folder)


def draw(rows: np.ndarray, folder: Path) -> None:
    """Seconds and their ratio against the number of weights."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    for k, (robots, colour) in enumerate(zip(ROBOTS, ("#0072B2", "#D55E00"), strict=True)):
        without, gradient = rows[:, 2 + 2 * k], rows[:, 3 + 2 * k]
        name = "1 robot" if robots == 1 else f"{robots} robots"
        left.loglog(rows[:, 0], without, "o--", color=colour, label=name, markersize=4)
        left.loglog(rows[:, 0], gradient, "o-", color=colour, label=f"{name}, with gradient", markersize=4)
        right.semilogx(rows[:, 0], gradient / without, "o-", color=colour, label=name, markersize=4)
    for axes, text in ((left, f"seconds for {STEPS} steps"), (right, "with gradient / without")):
        axes.axvline(split.MOST_WEIGHTS, color="#888888", linewidth=0.8, linestyle=":")
        axes.set_xlabel("weights")
        axes.set_ylabel(text)
        axes.grid(alpha=0.3)
    right.set_ylim(0, None)
    left.legend(fontsize=8)
    figure.savefig(folder / "weights.svg")


if __name__ == "__main__":
    if len(sys.argv) > 1 and sys.argv[1].isdigit():
        measure(list(HIDDEN[int(sys.argv[1])]))
    else:
        main(Path(sys.argv[1] if len(sys.argv) > 1 else "build"))
