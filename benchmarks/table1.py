"""The timing table of Degrave et al.: 10 s of a quadruped with 16 servos, one robot or 128, small net or large.

    python benchmarks/table1.py [rounds]

Every cell is the fastest of some rounds, with and without the gradient of the travelled distance with respect to all
weights. Each net runs in a process of its own, so that peak memory is that of the net.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # robots are shared out among threads, not matrices

import subprocess
import sys
import time
from functools import partial

import numpy as np
from table_robot import calls, fastest, peak, table_problem

STEPS = 1000
PAPER = {
    ("small", 1): ((1.06, 9.69), (8.17, 69.6)),
    ("large", 1): ((2.04, 9.69), (13.2, 75.0)),
    ("small", 128): ((47.7, 17.8), (263.0, 128.0)),
    ("large", 128): ((50.4, 18.3), (311.0, 129.0)),
}
"""Seconds without and with gradient, each on a CPU (i7-5930K) and a GPU (GTX 1080)."""
NETS = ("small", "large", "large32")
WORDS = {"small": "1,296 weights", "large": "1,147,904 weights", "large32": "1,147,904 weights, nets in float32"}


def main() -> None:
    """Measure all nets, one process each."""
    rounds = sys.argv[1] if len(sys.argv) > 1 else "5"
    print(f"seconds for {STEPS} steps of 10 ms, 20 sweeps, {os.cpu_count()} processors, the fastest of {rounds} rounds")
    for net in NETS:
        subprocess.run([sys.executable, __file__, net, rounds], check=True)


def measure(net: str, rounds: int) -> None:
    """All cells of one net."""
    began = time.perf_counter()
    hidden = [] if net == "small" else [1024, 1024]
    both = calls(table_problem(hidden, STEPS), "simd32" if net == "large32" else "simd")
    print(f"\n{WORDS[net]}: ready after {time.perf_counter() - began:.1f} s")
    for robots in (1, 128):
        few = rounds if robots == 1 or net == "small" else max(1, rounds // 3)
        published = PAPER[net.removesuffix("32"), robots]
        for name, call, paper in zip(("forward", "gradient"), both, published, strict=True):
            seconds, found = fastest(partial(call, robots), few)
            assert np.isfinite(found).all()
            cpu, gpu = paper
            ratios = f"CPU {cpu:g} s: {cpu / seconds:.0f} times, GPU {gpu:g} s: {gpu / seconds:.0f} times"
            print(f"  {robots:>3} robots {name:<9} {seconds:8.3f} s   ({ratios})", flush=True)
    print(f"  peak memory {peak():.2f} GB")


if __name__ == "__main__":
    if len(sys.argv) > 2:
        measure(sys.argv[1], int(sys.argv[2]))
    else:
        main()
