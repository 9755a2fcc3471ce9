"""Are all shipped problems solved, and how long does a user wait for each answer?

Each is a command ``symphys solve NAME``: from its start to the last page. The first one compiles, the second one finds
what the first has compiled. ``--times FILE`` writes seconds of the second for ``symphys list``, which reads
problems/times.json.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter

from bench import Row

COLUMNS = {
    "problem": "a shipped one",
    "solver": "the first that the problem names, or that is chosen for it",
    "verdict": "of the second command, or of the first where there is no second",
    "objective": "of it",
    "cold": "seconds of the first command, nothing cached",
    "warm": "seconds of the second one; of the first where that took more than ``long``",
    "solve": "of these, for the solver",
    "fault": "why there is no result",
}


def rows(
    quick: bool = False, problems: tuple[str, ...] = (), limit: float = 1200.0, long: float = 60.0, times: str = ""
) -> Iterator[Row]:
    """Yield a row for each problem.

    Args:
        quick: the ball throw alone.
        problems: names; all shipped ones that are to be solved if there are none.
        limit: seconds after which a command is given up.
        long: seconds of a first command from which there is no second.
        times: file for the seconds by name.
    """
    from start import solvers

    from symphys.problems import catalogue

    found = {}
    for name in ["ball_throw"] if quick else problems or catalogue():
        named = solvers(name)
        if not named:
            continue
        row = solved(name, named[0], limit, long)
        if "warm" in row:
            found[name] = float(f"{row['warm']:.2g}")
        yield row
    if times:
        Path(times).write_text(json.dumps(found, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def solved(name: str, solver: str, limit: float, long: float) -> Row:
    """Solve a problem by one or two commands."""
    row: Row = {"problem": name, "solver": solver}
    with tempfile.TemporaryDirectory() as folder:
        for kind in ("cold", "warm"):
            began, out = perf_counter(), Path(folder) / kind
            call = [sys.executable, "-m", "symphys", "solve", name, "--solver", solver, "--out", str(out)]
            env = {"SYMPHYS_CACHE": f"{folder}/cache"}
            try:
                done = subprocess.run(
                    call, env={**plain_environment(), **env}, capture_output=True, timeout=limit, check=False
                )
            except subprocess.TimeoutExpired:
                return row | {"fault": f"not within {limit:g} s"}
            row["warm"] = perf_counter() - began
            results = list(out.rglob("result.json"))
            if not results:
                return row | {"fault": " ".join(done.stderr.decode().split())[-200:]}
            result = json.loads(results[0].read_text("utf-8"))
            row |= {key: result.get(key) for key in ("verdict", "objective")}
            row["solve"] = result.get("seconds", {}).get("solve")
            if kind == "cold":
                row["cold"] = row["warm"]
                if row["cold"] > long:
                    break
    return row


def plain_environment() -> dict[str, str]:
    """Return the environment without what benchmarks of kernels set."""
    return {key: value for key, value in os.environ.items() if not key.startswith("SYMPHYS_")}
