"""Findings of a verification, graded by levels."""

from __future__ import annotations

import math
from collections.abc import Iterable

from symphys.records import dataclass

GOOD, FAIR, BAD, UNKNOWN = "good", "fair", "bad", "unknown"
MARKS = {GOOD: "good", FAIR: "look closer", BAD: "do not rely on it", UNKNOWN: "not judged"}


@dataclass(frozen=True)
class Finding:
    """A line of an examination: its subject, level, check, value and interpretation.

    ``doubt``: a clause on why no result that rests on it is to be relied on; empty where that does not follow.
    """

    about: str
    level: str
    what: str
    number: str
    meaning: str
    doubt: str = ""


@dataclass(frozen=True)
class Judged:
    """The judgement of what is examined.

    Attributes:
        objective: its value.
        worst: the largest error / tolerance; nan without any.
        met: whether nothing is missed, true also where there is nothing to meet.
        checked: whether there is anything to meet.
        costs: the sum of what is minimised, targets aside; nan where a goal says how small that must be.
        accepted: whether it is the answer of a run that nothing refutes: what speaks against its gradient alone is no
            reason not to rely on it.
    """

    objective: float
    worst: float
    met: bool
    checked: bool
    costs: float = math.nan
    accepted: bool = False


def graded(value: float, limits: tuple[float, float]) -> str:
    """Return the level of a number that had better be small."""
    if math.isnan(value):
        return UNKNOWN
    return GOOD if value <= limits[0] else FAIR if value <= limits[1] else BAD


def worst_of(levels: Iterable[str]) -> str:
    """Return the worst level; unknown without any."""
    return max(levels, key=(UNKNOWN, GOOD, FAIR, BAD).index, default=UNKNOWN)


def relative_change(before: float, after: float) -> float:
    """|after - before| / |before|; nan if one is not finite."""
    if not (math.isfinite(before) and math.isfinite(after)):
        return math.nan
    return abs(after - before) / max(abs(before), 1e-12)
