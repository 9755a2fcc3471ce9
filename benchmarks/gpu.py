"""How fast is a GPU on the table robot, against the batch, and what does single precision cost?

The robot of the benchmark ``table``. Errors of single precision are those of the processor: a GPU runs the same text
and rounds alike but for sin, exp and tanh. Without a GPU only these are measured.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from bench import Row, fastest
from measured_worlds import robots_of, starts, table_problem

from symphys.codegen import Kernel, KernelUnavailable, compile_program
from symphys.codegen.cuda import DeviceKernel, compile_on, find_gpu
from symphys.transcription import rollout_program, symbolic_rollout
from symphys.transcription.network_rollout import LargeEvaluator
from symphys.transcription.transcribe import transcribe_large
from symphys.types import Array

STEPS, ROBOTS, LENGTHS = 1000, (1, 128, 1024, 8192), (10, 100, 1000)
COLUMNS = {
    "device": "that computes",
    "weights": "of the net",
    "precision": "of the numbers",
    "robots": "rollouts in one call",
    "steps": "of 10 ms",
    "forward_s": "seconds of a call without gradient",
    "gradient_s": "seconds of a call with gradient",
    "million_steps_s": "10^6 robots x steps a second, with gradient",
    "compile_s": "seconds to compile",
    "value_off": "difference from double precision on the processor [m], median over robots",
    "value_worst": "the same, largest",
    "gradient_off": "difference of gradients by their norm, median over robots",
    "gradient_worst": "the same, largest",
}


def rows(quick: bool = False, rounds: int = 3) -> Iterator[Row]:
    """Yield errors of single precision, then times of the device."""
    robots = 4 if quick else 128
    for steps in LENGTHS[:1] if quick else LENGTHS:
        problem = table_problem([1] if quick else [], steps)
        program = rollout_program(symbolic_rollout(problem), exact=True)
        kernels = [compile_program(program, precision=each, seeded=["merit"]) for each in ("double", "single")]
        errors = differences(*kernels, robots_of(problem, robots))
        yield {"device": "processor", "precision": "single", "robots": robots, "steps": steps, **errors}
    try:
        gpu = find_gpu()
    except KernelUnavailable as error:
        print(f"no times: {error}")
        return
    program = rollout_program(symbolic_rollout(table_problem([], STEPS)), exact=True)
    short = table_problem([], 100)
    short_program = rollout_program(symbolic_rollout(short), exact=True)
    reference = compile_program(short_program, seeded=["merit"])
    for precision in ("double", "single"):
        other = compile_on(gpu, short_program, precision, ["merit"])  # type: ignore[arg-type]
        errors = differences(reference, other, robots_of(short, 128))
        yield {"device": gpu.name, "precision": precision, "robots": 128, "steps": 100, **errors}
        kernel = compile_on(gpu, program, precision, ["merit"])  # type: ignore[arg-type]
        for robots in ROBOTS[:2] if quick else ROBOTS:
            yield times(gpu.name, precision, kernel, robots, rounds)
    if not quick:
        yield from large(gpu.name, rounds)


def differences(one: Kernel | DeviceKernel, other: Kernel | DeviceKernel, Z: Array) -> Row:
    """Return how far values and gradients of two kernels are apart."""
    (ends, slopes), (near, close) = (kernel.gradient(Z, [1.0], [0.0]) for kernel in (one, other))
    off = np.abs(near["objective"][:, 0] - ends["objective"][:, 0])
    wrong = np.linalg.norm(close - slopes, axis=1) / np.linalg.norm(slopes, axis=1)
    names = ("value_off", "value_worst", "gradient_off", "gradient_worst")
    found = (np.median(off), off.max(), np.median(wrong), wrong.max())
    return dict(zip(names, map(float, found), strict=True))


def times(device: str, precision: str, kernel: DeviceKernel, robots: int, rounds: int) -> Row:
    """Measure the small net within the compiled step."""
    Z = robots_of(table_problem([], STEPS), robots)
    calls = partial(kernel.forward, Z, [0.0]), partial(kernel.gradient, Z, [1.0], [0.0])
    for call in calls:
        call()  # the first one copies the program to the device
    forward, gradient = (fastest(call, rounds) for call in calls)
    row: Row = {"device": device, "weights": 1296, "precision": precision, "robots": robots, "steps": STEPS}
    row |= {"forward_s": forward, "gradient_s": gradient, "million_steps_s": 1e-6 * robots * STEPS / gradient}
    return row | {"compile_s": kernel.report.seconds}


def large(device: str, rounds: int) -> Iterator[Row]:
    """Yield the net of a million weights, whose products are the device's library's."""
    problem = table_problem([1024, 1024], STEPS)
    weights = [problem.variables[0].guess]
    for backend, precision in (("cuda", "double"), ("cuda32", "net in single")):
        evaluator = transcribe_large(problem, exact=True, backend=backend, threads=None).shooting.evaluator
        assert isinstance(evaluator, LargeEvaluator)
        for robots in ROBOTS[:3]:
            seconds = [
                fastest(partial(evaluator.shared, weights, starts(robots), gradient=each), rounds)
                for each in (False, True)
            ]
            row: Row = {"device": device, "weights": weights[0].size, "precision": precision, "robots": robots}
            row |= {"steps": STEPS, "forward_s": seconds[0], "gradient_s": seconds[1]}
            yield row | {"million_steps_s": 1e-6 * robots * STEPS / seconds[1], "compile_s": None}
