"""Options that all solvers share: limits of a solve, checks, and names as they are recorded."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, fields
from difflib import get_close_matches
from typing import Any, ClassVar

from symphys.errors import SymphysError
from symphys.records import dataclass
from symphys.solvers.core.outcome import Status, StopReason, TraceRow

TIME_USED_UP = "the time is used up: raise `max_seconds`"


@dataclass(frozen=True, kw_only=True)
class SolverOptions:
    """Options of every solver: limits of the whole solve, over all stages of smoothing.

    A limit is a field, with its line in the attributes, its check in ``__post_init__`` and its end in ``spent``. The
    driver asks it after each iteration. Nothing else depends on which limits there are.

    Attributes:
        max_seconds: the time that a solve may take [s], including interrupted sessions, without building and compiling.
    """

    __pydantic_config__: ClassVar[dict[str, object]] = {"extra": "forbid"}

    max_seconds: float = math.inf

    def __post_init__(self) -> None:
        """Raise ValueError, which names the option and what would be valid."""
        require(self.max_seconds > 0, "max_seconds", "above 0")

    def spent(self, row: TraceRow) -> StopReason | None:
        """Return why the solve ends after the iteration of this row; None to go on."""
        return StopReason(Status.BUDGET, TIME_USED_UP) if row.seconds >= self.max_seconds else None


def require(holds: bool, name: str, valid: str) -> None:
    """Raise ValueError unless the condition holds: ``name`` must be ``valid``."""
    if not holds:
        raise ValueError(f"{name} must be {valid}")


def at_least(lowest: float, **options: float) -> None:
    """Raise ValueError unless every option is at least ``lowest``; NaN never is."""
    for name, value in options.items():
        require(value >= lowest, name, f"at least {lowest:g}")


def nearest(name: str, valid: Iterable[str]) -> str:
    """Return ``did you mean 'tol'?``; empty where no valid name comes close."""
    close = get_close_matches(name, list(valid))
    return f"did you mean {' or '.join(map(repr, close))}?" if close else ""


def refuse(solver: str, name: str, reason: str) -> SymphysError:
    """Return the error for an option of a library that cannot be passed on."""
    return SymphysError(f"solver.{solver}.options.{name}: {reason}")


def recorded_options(options: Any) -> dict[str, object]:
    """Return options as plain values; a renamed one (metadata "was" of its field) by its first name.

    Limits that are not set are left out. So the key of a run, which is made from all this, stays the same.
    """
    first = {field.name: field.metadata.get("was", field.name) for field in fields(options)}
    unset = {limit.name: limit.default for limit in fields(SolverOptions)}
    values = asdict(options).items()
    return {first[name]: value for name, value in values if name not in unset or value != unset[name]}
