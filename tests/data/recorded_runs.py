"""Run folders written without a solve, as a run writes them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from symphys import files
from symphys.results.config import Config, case_name
from symphys.results.file_names import CONFIG, PROBLEM, RESULT
from symphys.results.result import CheckRecord, Result, VariableRecord

TEXT = 'title = "A throw"\n'


def recorded(seed: int = 0, objective: float = 0.5, verdict: str = "solved", **changed: Any) -> Result:
    """A result with every column of the table."""
    vector = np.array([[1.0], [2.0]])
    fields: dict[str, Any] = {
        "problem": "throw",
        "title": "A throw",
        "solver": "gradient",
        "seed": seed,
        "solved": verdict == "solved",
        "status": "met" if verdict == "solved" else "budget",
        "advice": "" if verdict == "solved" else "try more iterations",
        "objective": objective,
        "costs": {"effort": 0.25},
        "outputs": {"speed [m/s]": 3.0},
        "checks": (CheckRecord("target", "there", 0.1, 0.2, 0.5, True, "m"),),
        "z": {"throw": VariableRecord("throw", ("ball.velocity",), vector, 0 * vector, vector - 9, vector + 9)},
        "iterations": 7,
        "equivalents": 30.5,
        "seconds": {"build": 0.1, "compile": 0.2, "solve": 0.3},
        "trust": {"deepest": 0.0, "size": 0.1},
        "versions": {"symphys": "0.1.0", "casadi": "3.8.2"},
        "provenance": {"host": "here", "pid": 7, "peak_memory": 2**30},
        "when": "2026-11-23T22:00:00+00:00",
        "verdict": verdict,
    }
    return Result(**(fields | changed))


def record(out: Path, result: Result | None = None, **settings: Any) -> Path:
    """Write a run folder below ``out``; the folder."""
    result = result or recorded()
    given = {key.replace("__", "."): value for key, value in settings.items()}
    folder = out / case_name(result.problem, given) / f"{result.solver}-seed{result.seed}"
    config = Config(result.problem, result.solver, result.seed, given, {"iterations": 50}, "casadi", "key")
    files.write_text(folder / PROBLEM, TEXT)
    files.write_json(folder / CONFIG, config.to_json())
    files.write_json(folder / RESULT, result.to_json())
    return folder
