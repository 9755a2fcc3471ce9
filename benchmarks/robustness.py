"""Whether a gait that is learnt under domain randomization walks where one that is learnt in one sample falls.

    python benchmarks/robustness.py [FOLDER [SEEDS]]

The conjecture of Degrave et al. Each seed learns ``quadruped_walk`` twice (``walking.LONG``), with the same work: in
batches of samples that are drawn anew, and in the problem's own sample alone, a gradient an iteration, which
costs what eight cost. Then each gait walks in 500 samples that neither has seen, drawn half, once, one and a half
times and twice as widely as the problem's tables say. It succeeds where it stays within 30 degrees of upright for 10 s
and keeps 70 % of its own speed.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from walking import LEAST, LONG, UNSEEN, Walks

from symphys.problem import load_problem
from symphys.problems import find
from symphys.report.figures import style
from symphys.runs.job import solver_options
from symphys.solvers import SOLVERS
from symphys.types import Array

WIDTHS = (0.5, 1.0, 1.5, 2.0)
SEEDS, STREAM = 5, 1997
WAYS = {"varied": "learnt under domain randomization", "nominal": "learnt in one sample"}


def main() -> None:
    """A line for each gait, then for all together, then a figure."""
    folder, seeds = (
        Path(sys.argv[1] if len(sys.argv) > 1 else "build"),
        int(sys.argv[2] if len(sys.argv) > 2 else SEEDS),
    )
    walks = Walks(load_problem(find("quadruped_walk")))
    rates = {way: np.array([measured(walks, way, seed) for seed in range(seeds)]) for way in WAYS}
    for way, each in rates.items():
        low, high = interval(each.sum(axis=0) * UNSEEN, seeds * UNSEEN)
        told = ", ".join(f"{w:g}: {r:.3f} ({a:.3f} to {b:.3f})" for w, r, a, b in zip(WIDTHS, each.mean(0), low, high,
                                                                                  strict=True))  # fmt: skip
        print(f"{WAYS[way]}, all seeds: {told}")
    folder.mkdir(exist_ok=True)
    drawn(rates).savefig(folder / "robustness.svg")


def measured(walks: Walks, way: str, seed: int) -> Array:
    """(widths,) the share that succeeds."""
    options = replace(solver_options(walks.problem, "stochastic"), **LONG)
    if way == "nominal":
        blocks = options.iterations * options.samples // walks.scenario.kernels[0].report.lanes
        options = replace(options, iterations=blocks, samples=1, width=0.0, validation=1, validation_width=0.0)
    shooting = walks.made.shooting
    z = SOLVERS["stochastic"].solve(shooting, shooting.start(seed), options, seed).z
    shares, speeds = [], []
    for k, width in enumerate(WIDTHS):
        drawn = walks.scenario.draw(np.random.default_rng([STREAM, k]), UNSEEN, width)
        speed, upright = walks(z, drawn)
        shares.append(float((upright & (speed >= LEAST * speed[0])).mean()))
        speeds.append(speed[0])
    print(
        f"{way} seed {seed}: {speeds[0]:.2f} m/s; succeed: {', '.join(f'{share:.3f}' for share in shares)}", flush=True
    )
    return np.array(shares)


def interval(successes: Array, count: int) -> tuple[Array, Array]:
    """Wilson's of 95 %."""
    z, share = 1.96, successes / count
    middle = (share + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z * np.sqrt(share * (1 - share) / count + z**2 / (4 * count**2)) / (1 + z**2 / count)
    return middle - half, middle + half


def drawn(rates: Mapping[str, Array]) -> Figure:
    """Success against how widely samples differ."""
    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    axes = figure.subplots()
    for (way, each), colour in zip(rates.items(), style.BODIES, strict=False):
        low, high = interval(each.sum(axis=0) * UNSEEN, len(each) * UNSEEN)
        for shares in each:
            axes.plot(WIDTHS, shares, color=colour, linewidth=0.7, alpha=0.4)
        bars = np.abs(np.stack([low, high]) - each.mean(axis=0))
        axes.errorbar(WIDTHS, each.mean(axis=0), bars, color=colour, linewidth=2, capsize=3, label=WAYS[way])
    axes.set(xlabel="width of the samples, of the problem's tables", ylabel="share that succeeds", ylim=(0, 1.02))
    axes.set_xticks(WIDTHS)
    axes.legend(frameon=False)
    return figure


if __name__ == "__main__":
    main()
