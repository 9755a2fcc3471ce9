"""How long does a user wait for the first gradient, and what does the Python interface add to a kernel?

Each start is a process of its own, with a cache of kernels that is empty at the first start. Modules are bytecode, as
in an installed package: a start before the first one writes it. Seconds are those of processors, of Python and of
compilers, so that other work on the machine counts little; ``wall`` is the clock's, and ``kernel`` is the clock's until
the kernel is there that is compiled beside a first start.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

from bench import Row, all_turns, in_process, peak, spent

NAMES = ("ball_throw", "cart_pole", "hopper_gait", "push_box", "table_robot", "quadruped_walk")
STEPS, ROBOTS = 100, 128
COLUMNS = {
    "problem": "a shipped problem, or the table robot with a net",
    "start": "the first one compiles, the second one finds its kernels",
    "import": "seconds of processors",
    "load": "seconds of processors",
    "build and compile": "seconds of processors",
    "first value": "seconds of processors",
    "first gradient": "seconds of processors",
    "all": "sum of these",
    "wall": "seconds of the clock until the first gradient",
    "kernel": "seconds of the clock until the kernel is compiled",
    "memory": "most memory of the process [MiB]",
    "cache": "of kernels after the start [MiB]",
    "call": "what is compared with what it calls",
    "inner_ms": "milliseconds of the inner call",
    "ratio": "median ratio of the outer call to the inner one",
}
PHASES = tuple(COLUMNS)[2:7]


def rows(quick: bool = False, problems: tuple[str, ...] = NAMES, repeats: int = 15) -> Iterator[Row]:
    """Yield two starts of each problem, then what calls through the interface take.

    Args:
        quick: the ball throw alone.
        problems: names of shipped problems, or "table_robot".
        repeats: turns of the calls.
    """
    with TemporaryDirectory() as bytecode:
        if not quick:
            list(starts("ball_throw", bytecode))  # writes the bytecode
        for name in problems[:1] if quick else problems:
            for which, found in zip(("first", "second"), starts(name, bytecode), strict=True):
                whole = sum(found[phase] for phase in PHASES)
                rest = {key: found[key] for key in ("wall", "kernel", "memory", "cache")}
                phases = {phase: found[phase] for phase in PHASES}
                yield {"problem": name, "start": which, **phases, "all": whole, **rest}
    yield from interface(2 if quick else ROBOTS, 5 if quick else STEPS, 1 if quick else repeats)


def starts(name: str, bytecode: str) -> Iterator[dict[str, Any]]:
    """Yield a first start and a second one, with the size of the cache after each [MiB]."""
    with TemporaryDirectory() as folder:
        own = {"SYMPHYS_CACHE": folder, "PYTHONPYCACHEPREFIX": bytecode, "PYTHONDONTWRITEBYTECODE": ""}
        for _ in range(2):
            found = dict(in_process(start, name, env=own))
            kept = sum(path.stat().st_size for path in Path(folder).iterdir()) / 2**20
            yield found | {"cache": kept}


def start(name: str) -> dict[str, Any]:
    """Measure each phase of a start in this process."""
    found: dict[str, Any] = {}
    began = perf_counter()

    def timed(phase: str, call: Callable[[], Any]) -> Any:
        before = spent()
        result = call()
        found[phase] = spent() - before
        return result

    symphys = timed("import", lambda: __import__("symphys"))
    problem = timed("load", lambda: loaded(name))
    rollout = timed("build and compile", lambda: symphys.compile(problem))
    timed("first value", lambda: rollout.value(rollout.z()))
    timed("first gradient", lambda: rollout.gradient(rollout.z()))
    found["wall"] = perf_counter() - began
    found["memory"] = peak()
    rollout.finish()
    found["kernel"] = perf_counter() - began
    return found


def loaded(name: str) -> Any:
    """Load the problem."""
    import symphys

    if name != "table_robot":
        return symphys.load(name)
    from measured_worlds import table_problem

    return table_problem([], STEPS)


def interface(robots: int, steps: int, repeats: int) -> Iterator[Row]:
    """Yield ``rollout.gradient`` against its kernel, and ``symphys.solve`` against its solver."""
    import numpy as np
    from measured_worlds import table_problem

    import symphys

    rollout = symphys.compile(table_problem([], steps))
    rollout.finish()
    Z = rollout.z() + 0.01 * np.random.default_rng(0).standard_normal((robots, rollout.n))
    evaluator = rollout._made.shooting.evaluator
    kernel, parameters, seeds = evaluator.kernel, evaluator.parameters(0.0), evaluator.steepest
    calls = {"inner": lambda: kernel.gradient(Z, seeds, parameters), "outer": lambda: rollout.gradient(Z)}
    times = all_turns(calls, repeats)
    ratio = statistics.median(b / a for a, b in zip(times["inner"], times["outer"], strict=True))
    name = f"rollout.gradient of {robots} table robots, {steps} steps, by its kernel"
    yield {"call": name, "inner_ms": 1e3 * statistics.median(times["inner"]), "ratio": ratio}
    problem, inner, ratios = symphys.load("ball_throw"), list[float](), list[float]()
    for _ in range(repeats + 1):  # the first one compiles
        began = perf_counter()
        found = symphys.solve(problem, "least_squares")
        inner.append(found.run.seconds["solve"])
        ratios.append((perf_counter() - began) / inner[-1])
    ms = 1e3 * statistics.median(inner[1:])
    name = "symphys.solve of the ball throw, by its solver"
    yield {"call": name, "inner_ms": ms, "ratio": statistics.median(ratios[1:])}
