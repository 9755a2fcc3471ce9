"""What a person waits for: the whole of ``symphys solve NAME``, by this version and by an older one in turns.

    python benchmarks/whole_commands.py [NAME ...] [--before FOLDER] [--to rows.jsonl]

Without a NAME all shipped problems, and two of robots_and_balls/. Each version solves each problem twice, with a cache
of kernels that is empty at first. FOLDER is a checkout of the older version; both run in this Python. Seconds are those
of the clock, and those of processors, compilers included. Who learns for minutes does only three iterations, marked by
a star. What ``--to`` holds already is not measured again, so that an interrupted run goes on.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

HERE = Path(__file__).resolve().parents[1]
OWN = ("robots_and_balls/kick.toml", "robots_and_balls/volley.toml")
LEARNERS = (
    *("ant_walk", "gait_robot_build", "gait_robot_fast", "half_cheetah_run", "hopper_run"),
    *("quadruped_walk", "quadruped_walk_net", "walker2d_walk"),
)
IDENTIFIED = ("bounce_recorded",)
"""Problems of another command."""
SHORT = ("--set", "solver.stochastic.iterations=3", "--set", "solver.evolution.iterations=3")
STARTS = ("first", "second")


def command(problem: str, folder: Path) -> list[str]:
    """The command line of one solve into ``folder``."""
    short = SHORT if problem in LEARNERS else ()
    return [sys.executable, "-m", "symphys", "solve", problem, "--out", str(folder), "--quiet", *short]


def measured(words: list[str], environment: dict[str, str], folder: str) -> dict[str, Any]:
    """One command, with all processes that it waited for: seconds, MiB and how it ended."""
    began = perf_counter()
    process = subprocess.Popen(
        words, env=environment, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    told = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    code = process.returncode = os.waitstatus_to_exitcode(status)
    row = {"wall": perf_counter() - began, "processor": usage.ru_utime + usage.ru_stime, "code": code}
    # 1: solved no case, which a few iterations are not meant to; 2: no such problem, or no such key
    return {**row, "memory": usage.ru_maxrss / 1024, "told": told[-500:] if code > 1 else ""}


def solved_twice(problem: str, version: Path) -> Iterator[dict[str, Any]]:
    """A first and a second start of one version, each with the size of the cache afterwards [MiB]."""
    with TemporaryDirectory() as folder:
        kept = Path(folder) / "cache"
        environment = {**os.environ, "SYMPHYS_CACHE": str(kept), "PYTHONPATH": str(version)}
        for start in STARTS:
            row = measured(command(problem, Path(folder) / start), environment, folder)
            size = sum(path.stat().st_size for path in kept.rglob("*") if path.is_file()) / 2**20
            yield {"start": start, **row, "cache": size}


def rows_of(problem: str, versions: dict[str, Path]) -> list[dict[str, Any]]:
    """All rows of one problem, the versions in turns."""
    name = Path(problem).stem
    by_version = [
        [{"problem": name, "version": label, **row} for row in solved_twice(problem, version)]
        for label, version in versions.items()
    ]
    return [row for turn in zip(*by_version, strict=True) for row in turn]


def line(name: str, rows: list[dict[str, Any]]) -> str:
    """A line of the table: each number of the versions, divided by a slash."""

    def told(start: str, key: str, digits: int) -> str:
        chosen = [row for row in rows if (row["problem"], row["start"]) == (name, start)]
        return " / ".join(f"{row[key]:.{digits}f}" if row["code"] < 2 else "not solved" for row in chosen)

    star = "*" if name in LEARNERS else ""
    cells = [told(start, key, 1) for start in STARTS for key in ("wall", "processor")]
    return "| " + " | ".join([f"`{name}`{star}", *cells, told("first", "memory", 0), told("second", "cache", 1)]) + " |"


def main() -> None:
    """A line for each problem."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", metavar="NAME", nargs="*")
    parser.add_argument("--before", type=Path, metavar="FOLDER")
    parser.add_argument("--to", type=Path, metavar="FILE")
    options = parser.parse_args()
    own = [str(HERE / "benchmarks" / name) for name in OWN]
    given = [str(Path(name).resolve()) if Path(name).is_file() else name for name in options.names]
    shipped = (path.stem for path in sorted((HERE / "problems").glob("*.toml")))
    names = given or [*(name for name in shipped if name not in IDENTIFIED), *own]
    before = {} if options.before is None else {"before": options.before.resolve()}
    done = options.to.read_text().splitlines() if options.to and options.to.exists() else []
    rows = [json.loads(text) for text in done]
    print(f"Each cell: {' / '.join([*before, 'now'])}")
    print("| problem | first start [s] | of processors | second [s] | of processors | memory [MiB] | cache [MiB] |")
    print("|---|---|---|---|---|---|---|")
    for problem in names:
        name = Path(problem).stem
        if name not in {row["problem"] for row in rows}:
            new = rows_of(problem, {**before, "now": HERE})
            rows += new
            if options.to:
                with options.to.open("a") as file:
                    file.writelines(json.dumps(row) + "\n" for row in new)
        print(line(name, rows), flush=True)


if __name__ == "__main__":
    main()
