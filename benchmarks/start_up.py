"""What a user waits for before the first gradient: a first start of a problem, and a second one.

    python benchmarks/start_up.py [NAME ...]

Each start is a process of its own, with a cache of kernels that is empty at first. Modules are bytecode, as a package
is installed: a start before the first writes it, whatever $PYTHONDONTWRITEBYTECODE says. Seconds are those of
processors, of Python and of compilers, so that other work on the machine counts little; ``wall`` is the clock's, and
``kernel`` is the clock's until the kernel is there that is compiled beside a first start. ``--repeats`` starts each
problem again from its kernel, and prints the least and the median. ``table_robot`` is the robot of table_robot.py with
a net; other names are those of shipped problems.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

NAMES = ("ball_throw", "cart_pole", "hopper_gait", "push_box", "table_robot", "quadruped_walk")
STEPS = 100
CHILD = "--child"
PHASES = ("import", "load", "build and compile", "first value", "first gradient")


def spent() -> float:
    """[s] of processors so far, in this process and in the compilers that it waited for."""
    return sum(sum(getrusage(who)[:2]) for who in (RUSAGE_SELF, RUSAGE_CHILDREN))


def start(name: str) -> dict[str, Any]:
    """Seconds of each phase of one start."""
    found: dict[str, Any] = {}
    began = perf_counter()

    def timed(phase: str, call: Callable[[], Any]) -> Any:
        before = spent()
        result = call()
        found[phase] = spent() - before
        return result

    def load() -> Any:
        if name != "table_robot":
            return symphys.load(name)
        from table_robot import table_problem

        return table_problem([], STEPS)

    symphys = timed("import", lambda: __import__("symphys"))
    problem = timed("load", load)
    rollout = timed("build and compile", lambda: symphys.compile(problem))
    timed("first value", lambda: rollout.value(rollout.z()))
    timed("first gradient", lambda: rollout.gradient(rollout.z()))
    found["wall"] = perf_counter() - began
    found["memory"] = getrusage(RUSAGE_SELF).ru_maxrss / 1024
    rollout.finish()
    found["kernel"] = perf_counter() - began
    return found


def starts(name: str, bytecode: str, again: int = 0) -> list[dict[str, Any]]:
    """A first start, a second and ``again`` more, and the MiB of the cache after each."""
    rows = []
    own = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    with TemporaryDirectory() as folder:
        for _ in range(2 + again):
            told = subprocess.run(
                [sys.executable, __file__, CHILD, name],
                env={**own, "SYMPHYS_CACHE": folder, "PYTHONPYCACHEPREFIX": bytecode},
                capture_output=True,
                text=True,
                check=True,
            ).stdout
            kept = sum(path.stat().st_size for path in Path(folder).iterdir()) / 2**20
            rows.append({**json.loads(told.splitlines()[-1]), "cache": kept})
    return rows


def numbers(row: Mapping[str, Any]) -> list[float]:
    """The seconds of a row."""
    return [*(row[phase] for phase in PHASES), sum(row[phase] for phase in PHASES), row["wall"], row["kernel"]]


def shown(name: str, which: str, seconds: Iterable[float], row: Mapping[str, Any]) -> None:
    """Print a row."""
    told = " | ".join(f"{number:.2f}" for number in seconds)
    print(f"| `{name}` | {which} | {told} | {row['memory']:.0f} | {row['cache']:.1f} |", flush=True)


def main() -> None:
    """A row for each start."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", metavar="NAME", nargs="*", default=NAMES)
    parser.add_argument("--repeats", type=int, default=0, help="more starts from a kernel that is there")
    given = parser.parse_args()
    print("| problem | start | " + " | ".join(PHASES) + " | all | wall | kernel | memory [MiB] | cache [MiB] |")
    with TemporaryDirectory() as bytecode:
        starts("ball_throw", bytecode)
        for name in given.names:
            first, second, *more = starts(name, bytecode, given.repeats)
            shown(name, "first", numbers(first), first)
            shown(name, "second", numbers(second), second)
            if more:
                columns = list(zip(*map(numbers, [second, *more]), strict=True))
                shown(name, "least", map(min, columns), second)
                shown(name, "median", map(median, columns), second)


if __name__ == "__main__":
    if sys.argv[1:2] == [CHILD]:
        print(json.dumps(start(sys.argv[2])))
    else:
        main()
