"""Results in words and short numbers."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from symphys.runs import Job, Result

MANY_PAIRS = 50
SECONDS_PER_PAIR = 0.3
"""To build a problem, its step in pieces and as one expression; measured with heaps of 8 and 16 spheres."""


def many_pairs(name: str, pairs: int) -> str:
    """What to say of a world in which many surfaces may meet; nothing of others."""
    if pairs <= MANY_PAIRS:
        return ""
    return (
        f"{name}: {pairs} pairs of surfaces may meet; each is computed in every step, and building takes about "
        f"{SECONDS_PER_PAIR * pairs:.0f} s. `collides_with` leaves out those that never meet"
    )


def number(value: float | None, digits: int = 3) -> str:
    """A short number; a dash for what is not known."""
    if value is None or math.isnan(value):
        return "-"
    return f"{value:.{digits}g}"


def measured(value: float, unit: str) -> str:
    """A short number with its unit, if it has one."""
    return " ".join(filter(None, (number(value), unit)))


def labelled(name: str, value: float | None) -> str:
    """A number by its name, such as ``speed [m/s]``, with the unit behind it."""
    what, unit = name[:-1].rsplit(" [", 1) if name.endswith("]") and " [" in name else (name, "")
    return " ".join(filter(None, [what, number(value), unit]))


def whole(value: float | None) -> str:
    """A number of things."""
    return "-" if value is None or not math.isfinite(value) else f"{value:,.0f}"


def duration(seconds: float | None) -> str:
    """Seconds, without more digits than anybody reads."""
    if seconds is None:
        return "-"
    return f"{seconds:,.0f}" if seconds >= 100 else f"{seconds:.3g}"


def time_words(seconds: float) -> str:
    """A time to wait, rounded up, in the unit that suits it."""
    if seconds <= 100:
        return f"{math.ceil(seconds)} s"
    return f"{math.ceil(seconds / 60)} min" if seconds <= 6000 else f"{seconds / 3600:.1f} h"


def brief(job: Job, result: Result, skipped: bool) -> str:
    """One line on a run that is over."""
    if result.status == "failed" and skipped:
        return f"failed before: {first_line(result.advice)} (--rerun failed tries again)"
    if result.status == "failed":
        return f"failed: {first_line(result.advice)}"
    if skipped:
        return f"done before ({verdict(result)})"
    seconds = result.seconds.get("solve")
    words = f"{verdict(result)}, objective {number(result.objective)}, {result.iterations:.0f} iterations"
    return f"{words}, {duration(seconds)} s"


def verdict(result: Result) -> str:
    """Solved, or why not."""
    from symphys.findings.verdict import verdict_words

    return verdict_words(result.verdict, result.status, bool(result.checks))


def first_line(text: str) -> str:
    """The first line of a message."""
    return text.partition("\n")[0]
