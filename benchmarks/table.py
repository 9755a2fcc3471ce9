"""How do seconds compare with the timing table of Degrave et al. (2019), and how do they grow with the net?

A quadruped with 16 servos walks for 10 s by a net on 81 sensors: one robot or 128, a small net or a large one, with and
without the gradient of the distance with respect to all weights. Then nets of 10^2 to 10^6 weights over 2 s; up to
some size they are part of the compiled step, larger ones are evaluated beside it. Each net is measured in a process of
its own, so that its peak memory is that of the net.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from bench import Row, fastest, in_process, peak
from measured_worlds import robots_of, starts, table_problem

from symphys.codegen import compile_program
from symphys.problem import Problem
from symphys.transcription import symbolic_rollout
from symphys.transcription.network_rollout import LargeEvaluator, has_large_nets
from symphys.transcription.program import rollout_program
from symphys.transcription.transcribe import transcribe_large
from symphys.types import Array

STEPS, FEWER_STEPS = 1000, 200
COLUMNS = {
    "weights": "of the net",
    "net": "where it is evaluated: in the compiled step, beside it, or beside it in single precision",
    "robots": "rollouts in one call",
    "steps": "of 10 ms",
    "forward_s": "seconds of a call without gradient",
    "gradient_s": "seconds of a call with gradient",
    "paper_cpu": "times as fast as the published seconds with gradient on a processor (i7-5930K)",
    "paper_gpu": "times as fast as the published seconds with gradient on a GPU (GTX 1080)",
    "memory_gb": "peak memory of the process [GB]",
}
PAPER = {(0, 1): (8.17, 69.6), (1, 1): (13.2, 75.0), (0, 128): (263.0, 128.0), (1, 128): (311.0, 129.0)}
"""Seconds with gradient, by large net and robots."""
TABLE = (([], "simd"), ([1024, 1024], "simd"), ([1024, 1024], "simd32"))
GROWING = ([1], [4], [12], [], [40], [100], [256], [256, 256], [512, 512], [1024, 1024])


def rows(quick: bool = False, rounds: int = 5, growth: bool = True) -> Iterator[Row]:
    """Yield the cells of the table, then those of growing nets.

    Args:
        quick: the smallest net over ten steps.
        rounds: calls of which the fastest counts.
        growth: whether growing nets are measured.
    """
    if quick:
        yield from in_process(measure, [1], "simd", 10, 1)
        return
    for hidden, backend in TABLE:
        yield from in_process(measure, hidden, backend, STEPS, rounds)
    for hidden in GROWING if growth else ():
        yield from in_process(measure, hidden, "simd", FEWER_STEPS, 3)


def measure(hidden: list[int], backend: str, steps: int, rounds: int) -> list[Row]:
    """Measure one net in this process."""
    problem = table_problem(hidden, steps)
    large = has_large_nets(problem)
    net = ("beside, single precision" if backend == "simd32" else "beside") if large else "within"
    forward, gradient = beside(problem, backend) if large else within(problem)
    found = []
    for robots in (1, 128):
        count = rounds if robots == 1 or not large else max(1, rounds // 3)
        assert np.isfinite(gradient(robots)).all()
        seconds = [fastest(partial(call, robots), count) for call in (forward, gradient)]
        row: Row = {"weights": problem.variables[0].guess.size, "net": net, "robots": robots, "steps": steps}
        row |= {"forward_s": seconds[0], "gradient_s": seconds[1]}
        published = PAPER[int(large), robots] if steps == STEPS else (None, None)
        row |= {
            key: None if paper is None else paper / seconds[1]
            for key, paper in zip(("paper_cpu", "paper_gpu"), published, strict=True)
        }
        found.append(row | {"memory_gb": peak() / 1e3})
    return found


Calls = tuple[Callable[[int], Any], Callable[[int], Array]]
"""Functions of a number of robots: their objectives; the gradient (w,) of their sum by the shared weights."""


def within(problem: Problem) -> Calls:
    """Return calls with the net in the compiled step, every robot with weights of its own."""
    kernel = compile_program(rollout_program(symbolic_rollout(problem), exact=True), seeded=["merit"])
    size = problem.variables[0].guess.size

    def gradient(robots: int) -> Array:
        return np.asarray(kernel.gradient(robots_of(problem, robots), [1.0], [0.0])[1][:, :size].sum(axis=0))

    return lambda robots: kernel.forward(robots_of(problem, robots), [0.0]), gradient


def beside(problem: Problem, backend: str) -> Calls:
    """Return calls with the net beside the compiled step, its weights shared."""
    made = transcribe_large(problem, exact=True, backend=backend, threads=None)
    weights, evaluator = [problem.variables[0].guess], made.shooting.evaluator
    assert isinstance(evaluator, LargeEvaluator)

    def gradient(robots: int) -> Array:
        found = evaluator.shared(weights, starts(robots), gradient=True).weights
        assert found is not None
        return found[0]

    return lambda robots: evaluator.shared(weights, starts(robots)), gradient
