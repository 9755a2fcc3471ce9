"""Which figures does README.md state, and what are they on this machine?

The throw of the README, by the solvers of ``make demo``: counts do not depend on the machine. Then the walk of ``make
demo-walk``, as a user would start it, with a cache of kernels that is empty.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

from bench import Row

README = Path(__file__).resolve().parents[1] / "README.md"
DEMO = ("gradient", "least_squares", "ipopt", "cma")
COLUMNS = {
    "problem": "a shipped one, or that of the README",
    "solver": "of the command",
    "solved": "whether everything that is asked for is met",
    "found": "the first variable [m/s]",
    "gradients": "of the solver",
    "jacobians": "of the solver",
    "rollouts": "without derivatives",
    "iterations": "of the solver",
    "solve_s": "seconds of the solve",
    "whole_s": "seconds of the whole command, with building, compiling and the report",
    "speed": "of the walk, in the problem's own sample [m/s]",
}


def rows(quick: bool = False) -> Iterator[Row]:
    """Yield the throw of the README, the throw of the demo by each solver, and the walk unless ``quick``."""
    (text,) = re.findall(r"^```toml\n(.*?)^```", README.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "throw.toml").write_text(text, encoding="utf-8")
        yield from runs(folder, "throw.toml", ("least_squares",))
        yield from runs(folder, "ball_throw", DEMO[:2] if quick else DEMO)
        if not quick:
            yield from runs(folder, "quadruped_walk", ("stochastic",))


def runs(folder: Path, problem: str, solvers: tuple[str, ...]) -> Iterator[Row]:
    """Solve a problem by one command, and yield a row of each of its runs."""
    out = folder / Path(problem).stem
    command = [sys.executable, "-m", "symphys", "solve", problem, "--solver", ",".join(solvers), "--out", str(out)]
    walk = ["--unexamined"] if problem == "quadruped_walk" else []
    began = perf_counter()
    environment = os.environ | {"SYMPHYS_CACHE": str(folder / "cache")}
    environment.pop("SYMPHYS_WAIT", None)  # as a user starts it
    subprocess.run([*command, *walk], cwd=folder, env=environment, check=True, capture_output=True)
    whole = perf_counter() - began
    for name in solvers:
        yield row(out, Path(problem).stem, name, whole)


def row(out: Path, problem: str, name: str, whole: float) -> Row:
    """Return what a run's result.json says."""
    result: dict[str, Any] = json.loads((out / problem / f"{name}-seed0" / "result.json").read_text(encoding="utf-8"))
    first = next(iter(result["z"].values()))["value"]
    return {
        "problem": problem,
        "solver": name,
        "solved": result["solved"],
        "found": " ".join(f"{number:.4g}" for number in first) if len(first) == 3 else None,
        **{key: result["counts"][key] for key in ("gradients", "jacobians", "rollouts")},
        "iterations": result["iterations"],
        "solve_s": result["seconds"]["solve"],
        "whole_s": whole,
        "speed": result["outputs"].get("speed [m/s]"),
    }
