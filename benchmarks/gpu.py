"""The timing table on a GPU, robots and steps a second against the batch, and what bounds them.

    python benchmarks/gpu.py [rounds]

Without a GPU: the floors on paper, and what the compiler says of registers and spills. Floors: every operation of a
step on the units for double precision, and every word that its calls read and write from the device's memory, as if no
cache kept any; 128 robots wait for the longest chain of calls instead.
"""

from __future__ import annotations

import re
import sys
import time
from functools import partial

import numpy as np
from numpy.typing import NDArray
from table1 import STEPS
from table_robot import fastest, starts, table_problem

from symphys.codegen import KernelUnavailable, Program, compile_program
from symphys.codegen.cuda import Device, DeviceKernel, compile_on, find_gpu
from symphys.codegen.cuda.compiler import compiled
from symphys.codegen.cuda.kernel import WARPS
from symphys.codegen.cuda.schedule import schedules
from symphys.codegen.cuda.source import device_sources
from symphys.codegen.emit.plan import FAST_MEMORY, plan
from symphys.transcription import rollout_program, symbolic_rollout
from symphys.transcription.network_rollout import LargeEvaluator, transcribe_large

ROBOTS = (1, 128, 1024, 8192)
CARDS = {"A100": (108, 32, 1.41e9, 1.94e12), "H100": (132, 64, 1.98e9, 3.35e12), "H200": (132, 64, 1.98e9, 4.8e12)}
"""Multiprocessors, units for double precision in each, clock [Hz], memory [bytes/s]: NVIDIA's data sheets."""
PHASES = {"forward": ("body",), "gradient": ("body", "again", "back_body")}


def main() -> None:
    """Floors, the compiler's words, then the device's times."""
    rounds, problem = int(sys.argv[1]) if len(sys.argv) > 1 else 3, table_problem([], STEPS)
    program = rollout_program(symbolic_rollout(problem), exact=True)
    floors(program)
    try:
        gpu = find_gpu()
    except KernelUnavailable as error:
        told(program, "sm_90")
        print(f"no times: {error}")
        return
    told(program, gpu.architecture)
    for precision in ("double", "single"):
        kernel = compile_on(gpu, program, precision, ["merit"])  # type: ignore[arg-type]
        print(f"\n{gpu.name}, 1,296 weights, {precision}: compiled in {kernel.report.seconds:.0f} s")
        compared(gpu, precision)
        for robots in ROBOTS:
            small(kernel, problem.variables[0].guess, robots, rounds)
    large(rounds)


def floors(program: Program) -> None:
    """What a step takes at least, by arithmetic and by words."""
    planned = plan(program, ["merit"], FAST_MEMORY)
    found = schedules(planned, program, WARPS)
    bytes_each = 8 * (2 * program.size + planned.tape)
    print(f"{STEPS} steps of the table robot, {bytes_each / 2**20:.1f} MiB a robot, {WARPS} warps for 32 robots")
    for name, phases in PHASES.items():
        work, longest, words = (
            sum(getattr(found[phase], part) for phase in phases) for part in ("work", "longest", "words")
        )
        print(f"  {name}: {work:,} operations a step and robot, {longest:,} one after the other, {words:,} words")
        for card, (units, each, clock, memory) in CARDS.items():
            arithmetic, moved = units * each * clock / work, memory / (8 * words)
            print(f"    {card}: at most {arithmetic / 1e6:.0f} (arithmetic) and {moved / 1e6:.1f} (memory) million "
                  f"robots x steps/s; 128 robots: {STEPS * longest / clock:.2f} s at an operation a clock")  # fmt: skip


def told(program: Program, architecture: str) -> None:
    """Registers and spills, from the compiler."""
    planned, began = plan(program, ["merit"], FAST_MEMORY, noted=False), time.perf_counter()
    texts = device_sources(planned, program.steps, 32, WARPS, single=False)
    try:
        log = "\n".join(said for _, said in compiled(texts, architecture, ["--ptxas-options=-v"]))
    except KernelUnavailable as error:
        print(f"nothing of the compiler: {error}")
        return
    spills = [int(count) for count in re.findall(r"(\d+) bytes spill stores", log)]
    registers = [int(count) for count in re.findall(r"Used (\d+) registers", log)]
    print(f"  {architecture}: {len(spills)} functions in {time.perf_counter() - began:.0f} s, of which "
          f"{sum(count > 0 for count in spills)} spill, {sum(spills):,} bytes in all, at most {max(spills)}; the loops "
          f"use {max(registers)} registers, their functions up to 255: 2 blocks of {32 * WARPS} threads on a "
          "multiprocessor")  # fmt: skip


def compared(gpu: Device, precision: str) -> None:
    """The device's numbers against the processor's, over 100 steps with contact."""
    problem = table_problem([], 100)
    program = rollout_program(symbolic_rollout(problem), exact=True)
    rows = np.hstack([np.tile(problem.variables[0].guess, (128, 1)), starts(128)])
    here = compile_program(program, seeded=["merit"])
    there = compile_on(gpu, program, precision, ["merit"])  # type: ignore[arg-type]
    (ends, slopes), (near, close) = (kernel.gradient(rows, [1.0], [0.0]) for kernel in (here, there))
    off = np.abs(near["objective"] - ends["objective"]).max() / np.abs(ends["objective"]).max()
    wrong = np.abs(close - slopes).max() / np.abs(slopes).max()
    print(f"  100 steps of 128 robots: values off by {off:.1e}, gradients by {wrong:.1e} of the largest")


def small(kernel: DeviceKernel, weights: NDArray[np.float64], robots: int, rounds: int) -> None:
    """A cell of the table, and what part of the card's bandwidth its words would take if no cache kept any."""
    planned = plan(kernel.program, ["merit"], FAST_MEMORY)
    found, word = schedules(planned, kernel.program, WARPS), kernel.real.itemsize
    memory = next((card[-1] for name, card in CARDS.items() if name in kernel.device.name), np.nan)
    rows = np.hstack([np.tile(weights, (robots, 1)), starts(robots)])
    calls = {"forward": partial(kernel.forward, rows, [0.0]), "gradient": partial(kernel.gradient, rows, [1.0], [0.0])}
    for name, call in calls.items():
        call()
        seconds, _ = fastest(call, rounds)
        rate = robots * STEPS / seconds
        share = rate * word * sum(found[phase].words for phase in PHASES[name]) / memory
        print(f"  {robots:>5} robots {name:<9} {seconds:8.3f} s   {rate / 1e6:.3f} million robots x steps/s, "
              f"{share:.2f} of the bandwidth", flush=True)  # fmt: skip


def large(rounds: int) -> None:
    """The large net, its products by the device's library."""
    problem = table_problem([1024, 1024], STEPS)
    for backend in ("cuda", "cuda32"):
        made = transcribe_large(problem, exact=True, backend=backend)
        weights, evaluator = [problem.variables[0].guess], made.shooting.evaluator
        assert isinstance(evaluator, LargeEvaluator)
        print(f"\n1,147,904 weights: {made.backend}")
        for robots in ROBOTS[:3]:
            for name, gradient in (("forward", False), ("gradient", True)):
                seconds, _ = fastest(partial(evaluator.shared, weights, starts(robots), gradient=gradient), rounds)
                print(f"  {robots:>5} robots {name:<9} {seconds:8.3f} s", flush=True)


if __name__ == "__main__":
    main()
