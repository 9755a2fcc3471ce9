"""What the options of all solvers share: checks, and names as they are recorded."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, fields
from difflib import get_close_matches
from typing import Any

from symphys.errors import SymphysError


def require(holds: bool, name: str, valid: str) -> None:
    """ValueError unless it holds: ``name`` must be ``valid``."""
    if not holds:
        raise ValueError(f"{name} must be {valid}")


def at_least(lowest: float, **options: float) -> None:
    """ValueError unless every option is at least ``lowest``; NaN never is."""
    for name, value in options.items():
        require(value >= lowest, name, f"at least {lowest:g}")


def nearest(name: str, valid: Iterable[str]) -> str:
    """``did you mean 'tol'?``, or nothing where no valid name comes close."""
    close = get_close_matches(name, list(valid))
    return f"did you mean {' or '.join(map(repr, close))}?" if close else ""


def refuse(solver: str, name: str, reason: str) -> SymphysError:
    """The error for an option of a library that cannot be passed to it."""
    return SymphysError(f"solver.{solver}.options.{name}: {reason}")


def recorded_options(options: Any) -> dict[str, object]:
    """Options as plain values; one that was renamed (metadata "was" of its field) by its first name.

    So the key of a run, which is made from them, stays the same.
    """
    first = {field.name: field.metadata.get("was", field.name) for field in fields(options)}
    return {first[name]: value for name, value in asdict(options).items()}
