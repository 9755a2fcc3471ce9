"""Which method to take when: every method on the shipped problems from many starts, as data profiles and tables.

    python benchmarks/profiles.py [FOLDER] [--instances N] [--seconds S] [--work W] [--problems A,B] [--methods A,B]

Problems are those of the catalogue that have no scenarios and no net to learn, and whose gradient takes at most 50 ms.
Each is built and compiled once; instance 0 starts from its guess, the others from one perturbed by its spread. Solves
are lines of files in FOLDER/runs. A command that was ended goes on where it was; another budget needs another folder.
Tables and advice are printed, the figure is FOLDER/profiles.svg.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import perf_counter

from symphys import threads

threads.limit()

from profile_figures import write_profiles  # noqa: E402
from profile_runs import Budget, Cases, read_lines  # noqa: E402
from profile_tables import AXES, advice, class_table, problem_table, read  # noqa: E402

from symphys.problems import catalogue  # noqa: E402

PATIENCE = 3.0
"""A problem whose solves take so many times their budget, and ten minutes more, is given up."""
BUILDING = 600.0


def main(arguments: list[str] | None = None) -> int:
    """Do what is missing, and print the tables; the exit code."""
    asked = parsed(arguments)
    runs = asked.folder / "runs"
    budget = Budget(asked.work, asked.seconds)
    if asked.only:
        Cases(asked.only, runs, budget).run(asked.instances, asked.methods)
        return 0
    began = perf_counter()
    with ThreadPoolExecutor(asked.jobs) as pool:
        lost = [line for line in pool.map(lambda name: worked(name, asked), asked.problems or catalogue()) if line]
    print(f"{perf_counter() - began:.0f} s for what was missing, {asked.jobs} processes")
    if asked.report:
        report(asked.folder)
    print("\n".join(lost))
    return 1 if lost else 0


def parsed(arguments: list[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("folder", nargs="?", type=Path, default=Path("build/profiles"))
    parser.add_argument("--instances", type=int, default=15, help="starts of each problem")
    parser.add_argument("--seconds", type=float, default=Budget.seconds, help="of the processor, for each solve")
    parser.add_argument("--work", type=float, default=Budget.work, help="rollouts for each solve")
    parser.add_argument("--jobs", type=int, default=2, help="worker processes")
    parser.add_argument("--problems", type=names, default=(), help="instead of the catalogue")
    parser.add_argument("--methods", type=names, default=(), help="of those that apply")
    parser.add_argument("--no-report", dest="report", action="store_false", help="solve, and print no tables")
    parser.add_argument("--only", help=argparse.SUPPRESS)
    return parser.parse_args(arguments)


def names(text: str) -> tuple[str, ...]:
    """Names between commas."""
    return tuple(filter(None, text.split(",")))


def worked(name: str, asked: argparse.Namespace) -> str:
    """Solve one problem in a process of its own; a line where that process failed."""
    command = [sys.executable, __file__, str(asked.folder), f"--only={name}", f"--instances={asked.instances}"]
    command += [f"--seconds={asked.seconds}", f"--work={asked.work}", f"--methods={','.join(asked.methods)}"]
    solves = asked.instances * (len(asked.methods) or 8)
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=BUILDING + PATIENCE * solves * asked.seconds
        )
    except subprocess.TimeoutExpired:
        return f"{name}: given up, it takes too long"
    print(f"{name}: {max(len(read_lines(asked.folder / 'runs' / f'{name}.jsonl')) - 1, 0)} solves", flush=True)
    return f"{name}: {done.stderr.strip().splitlines()[-1]}" if done.returncode else ""


def report(folder: Path) -> None:
    """Print the tables, and draw the figure."""
    recorded = read(folder / "runs")
    count = len(recorded.solves)
    print(
        f"{count} solves of {len(recorded.problems)} problems; at most {recorded.budget.work:g} rollouts and ", end=""
    )
    print(
        f"{recorded.budget.seconds:g} s each, {sum(s.ends['seconds'] for s in recorded.solves) / 3600:.2f} h in all\n"
    )
    for group in recorded.groups:
        print(class_table(recorded, group), end="\n\n")
    for axis in AXES:
        print(problem_table(recorded, axis), end="\n\n")
    print("\n".join(advice(recorded)), end="\n\n")
    print("\n".join(f"left out: {name}: {why}" for name, why in recorded.left_out.items()))
    write_profiles(recorded, folder / "profiles.svg")


if __name__ == "__main__":
    sys.exit(main())
