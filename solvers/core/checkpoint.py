"""A solve that was interrupted, as plain JSON-able values, and back again without the loss of a bit."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import astuple, fields, is_dataclass
from enum import Enum
from functools import partial
from typing import Any, TypeVar

import numpy as np

from symphys.errors import SymphysError
from symphys.shooting import ShootingProblem
from symphys.solvers.core.evaluator import Snapshot
from symphys.solvers.core.outcome import Counts, StageResult, Status, TraceRow
from symphys.solvers.core.point import Point

T = TypeVar("T")
READERS: dict[str, Callable[[Any], Any]] = {
    "int": int,
    "float": float,
    "bool": bool,
    "Status": Status,
    "Array": lambda value: np.array(value, float),
    "dict[str, float]": lambda value: {str(key): float(number) for key, number in value.items()},
    "tuple[float, ...]": lambda value: tuple(float(number) for number in value),
}
"""By the annotation of a field; float() also reads the strings "nan" and "inf" of strict JSON."""


def to_checkpoint(solver: str, snapshot: Snapshot, rows: Iterable[TraceRow]) -> dict[str, object]:
    """Everything that ``from_checkpoint`` asks for."""
    best = snapshot.best
    return {
        "solver": solver,
        "stages": plain(snapshot.stages),
        "state": plain(snapshot.state),
        "best": {
            "z": plain(best.z),
            "merit": best.merit,
            "objective": best.objective,
            "errors": plain(best.errors),
            "outputs": plain(best.outputs),
            "spoilt": best.spoilt,
        },
        "last": plain(snapshot.last),
        "counts": list(astuple(snapshot.counts)),
        "seconds": snapshot.seconds,
        "rows": [list(astuple(row)) for row in rows],
    }


def from_checkpoint(
    checkpoint: dict[str, Any], solver: str, problem: ShootingProblem
) -> tuple[Snapshot, dict[str, Any], list[TraceRow]]:
    """The snapshot, the solver's state as plain values, the trace; SymphysError if damaged or of another solve."""
    if checkpoint.get("solver") != solver:
        raise SymphysError(f"this checkpoint is of the solver {checkpoint.get('solver')!r}, not of {solver!r}")
    try:
        best = checkpoint["best"]
        z, errors, outputs = (np.array(best[name], float) for name in ("z", "errors", "outputs"))
        numbers, met = (float(best["merit"]), float(best["objective"])), problem.met(errors)
        point = Point(z, *numbers, errors, met, outputs, spoilt=int(best["spoilt"]))
        counts = Counts(*map(int, checkpoint["counts"]))
        rows = [revive(TraceRow, dict(zip(names(TraceRow), row, strict=True))) for row in checkpoint["rows"]]
        stages = tuple(revive(StageResult, dict(each), Counts) for each in checkpoint["stages"])
        seconds = float(checkpoint["seconds"])
        state, last = dict(checkpoint["state"]), np.array(checkpoint["last"], float)
    except (KeyError, TypeError, ValueError) as error:
        raise damaged(error) from error
    if z.shape != (problem.n,):
        raise SymphysError(f"this checkpoint has {z.size} variables, the problem {problem.n}")
    if tuple(stage.smoothing for stage in stages) != problem.smoothing[:-1][: len(stages)]:
        raise SymphysError("this checkpoint has other stages of smoothing than the problem")
    return Snapshot(stages, state, point, last, counts, len(rows), seconds), state, rows


def revive(kind: type[T], values: dict[str, Any], *parts: type[Any]) -> T:
    """A dataclass of numbers, arrays and ``parts`` from their plain values; SymphysError if they do not fit."""
    readers = READERS | {part.__name__: partial(revive, part) for part in parts}
    types = {field.name: str(field.type) for field in fields(kind)}  # type: ignore[arg-type]
    try:
        return kind(**{name: readers[types[name]](values[name]) for name in types})
    except (KeyError, TypeError, ValueError) as error:
        raise damaged(error) from error


def plain(value: object) -> Any:
    """A dataclass, array, tuple or dict as dicts and lists of Python numbers and text, enumerations by their values."""
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
    """What to say of a checkpoint that cannot be read."""
    return SymphysError(f"the checkpoint is damaged ({error!r}): start afresh without it")


def names(kind: type[Any]) -> list[str]:
    """The fields of a dataclass in order."""
    return [field.name for field in fields(kind)]
