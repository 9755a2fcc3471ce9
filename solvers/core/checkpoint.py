"""Checkpoints of interrupted solves as plain JSON-able values, and back again without loss of a bit."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import astuple, fields, is_dataclass
from enum import Enum
from functools import partial
from typing import Any, TypeVar

import numpy as np

from symphys.errors import SymphysError
from symphys.records import dataclass
from symphys.shooting import ShootingProblem
from symphys.solvers.core.outcome import Counts, Outcome, StageResult, Status, TraceRow
from symphys.solvers.core.point import Point
from symphys.types import Array

T = TypeVar("T")
READERS: dict[str, Callable[[Any], Any]] = {
    "int": int,
    "float": float,
    "str": str,
    "bool": bool,
    "Status": Status,
    "Array": lambda value: np.array(value, float),
    "dict[str, float]": lambda value: {str(key): float(number) for key, number in value.items()},
    "tuple[float, ...]": lambda value: tuple(float(number) for number in value),
}
"""Readers by the annotation of a field; float() also reads the strings "nan" and "inf" of strict JSON."""
OUTCOME = "outcome"
"""The key of a checkpoint whose solve is over and only has to be judged."""
OLD_NAMES = {"miss": "max_violation"}
"""Present names by the names of fields in older checkpoints."""


@dataclass(frozen=True)
class Checkpoint:
    """The data from which a solve resumes, taken between two iterations.

    Attributes:
        stages: of smoothing, that were over by then.
        state: the method's own.
        best: of this stage.
        last: (n,) z of the last row of the trace.
        counts, rows, seconds: the work up to here, and the number of rows of the trace.
    """

    stages: tuple[StageResult, ...]
    state: object
    best: Point
    last: Array
    counts: Counts
    rows: int
    seconds: float


def to_plain(solver: str, checkpoint: Checkpoint, rows: Iterable[TraceRow]) -> dict[str, object]:
    """Return a checkpoint as plain values, which ``from_plain`` reads."""
    best = checkpoint.best
    return {
        "solver": solver,
        "stages": plain(checkpoint.stages),
        "state": plain(checkpoint.state),
        "best": {
            "z": plain(best.z),
            "merit": best.merit,
            "objective": best.objective,
            "errors": plain(best.errors),
            "outputs": plain(best.outputs),
            "spoilt": best.failed_samples,
        },
        "last": plain(checkpoint.last),
        "counts": list(astuple(checkpoint.counts)),
        "seconds": checkpoint.seconds,
        "rows": [list(astuple(row)) for row in rows],
    }


def from_plain(
    saved: dict[str, Any], solver: str, problem: ShootingProblem
) -> tuple[Checkpoint, dict[str, Any], list[TraceRow]]:
    """Return checkpoint, plain state of the method, and trace; SymphysError if damaged or of another solve."""
    if saved.get("solver") != solver:
        raise SymphysError(f"this checkpoint is of the solver {saved.get('solver')!r}, not of {solver!r}")
    try:
        best = saved["best"]
        z, errors, outputs = (np.array(best[name], float) for name in ("z", "errors", "outputs"))
        numbers, met = (float(best["merit"]), float(best["objective"])), problem.met(errors)
        point = Point(z, *numbers, errors, met, outputs, failed_samples=int(best["spoilt"]))
        counts = Counts(*map(int, saved["counts"]))
        rows = revived_rows(saved)
        stages = tuple(revive(StageResult, present(each), Counts) for each in saved["stages"])
        seconds = float(saved["seconds"])
        state, last = dict(saved["state"]), np.array(saved["last"], float)
    except (KeyError, TypeError, ValueError) as error:
        raise damaged(error) from error
    if z.shape != (problem.n,):
        raise SymphysError(f"this checkpoint has {z.size} variables, the problem {problem.n}")
    if tuple(stage.smoothing for stage in stages) != problem.smoothing[:-1][: len(stages)]:
        raise SymphysError("this checkpoint has other stages of smoothing than the problem")
    return Checkpoint(stages, state, point, last, counts, len(rows), seconds), state, rows


def plain_outcome(outcome: Outcome, solver: str, seconds: float) -> dict[str, object]:
    """Return the outcome of a solve that took ``seconds``, as plain values for ``revived_outcome``."""
    return {
        "solver": solver,
        "best": {"z": plain(outcome.z)},
        "counts": list(astuple(outcome.counts)),
        "seconds": seconds,
        "rows": [list(astuple(row)) for row in outcome.trace],
        OUTCOME: {
            "status": outcome.status.value,
            "advice": outcome.advice,
            "stages": plain(outcome.stages),
            "gains": plain(dict(outcome.gains)),
            "multipliers": plain(dict(outcome.multipliers)),
        },
    }


def revived_outcome(saved: dict[str, Any], solver: str) -> Outcome:
    """Return the outcome in a checkpoint; SymphysError if it is damaged or of another solver."""
    if saved.get("solver") != solver:
        raise SymphysError(f"this checkpoint is of the solver {saved.get('solver')!r}, not of {solver!r}")
    try:
        found = saved[OUTCOME]
        gains, multipliers = (
            {name: np.array(each, float) for name, each in found[key].items()} for key in ("gains", "multipliers")
        )
        return Outcome(
            status=Status(found["status"]),
            advice=str(found["advice"]),
            z=np.array(saved["best"]["z"], float),
            trace=tuple(revived_rows(saved)),
            counts=Counts(*map(int, saved["counts"])),
            stages=tuple(revive(StageResult, each, Counts) for each in found["stages"]),
            gains=gains,
            multipliers=multipliers,
        )
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise damaged(error) from error


def revived_rows(saved: dict[str, Any]) -> list[TraceRow]:
    """Return the trace in a checkpoint."""
    return [revive(TraceRow, dict(zip(names(TraceRow), row, strict=True))) for row in saved["rows"]]


def present(stage: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of a stage by their present names."""
    return {OLD_NAMES.get(name, name): value for name, value in stage.items()}


def revive(kind: type[T], values: dict[str, Any], *parts: type[Any]) -> T:
    """Make a dataclass of numbers, arrays and ``parts`` from plain values; SymphysError if they do not fit."""
    readers = READERS | {part.__name__: partial(revive, part) for part in parts}
    types = {field.name: str(field.type) for field in fields(kind)}  # type: ignore[arg-type]
    try:
        return kind(**{name: readers[types[name]](values[name]) for name in types})
    except (KeyError, TypeError, ValueError) as error:
        raise damaged(error) from error


def plain(value: object) -> Any:
    """Return a dataclass, array, tuple or dict as dicts and lists of plain values; enumerations by their values."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, tuple | list) else value


def damaged(error: Exception) -> SymphysError:
    """Return the error for a checkpoint that cannot be read."""
    return SymphysError(f"the checkpoint is damaged ({error!r}): start afresh without it")


def names(kind: type[Any]) -> list[str]:
    """Return the fields of a dataclass in order."""
    return [field.name for field in fields(kind)]
