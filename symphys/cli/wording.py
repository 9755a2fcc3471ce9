"""Results and progress of runs in words and short numbers."""

from __future__ import annotations

import contextlib
import math
from typing import TYPE_CHECKING

from symphys import files

if TYPE_CHECKING:
    from symphys.cli.watching.progress import BatchShare, StepProgress
    from symphys.runs import Job, Result
    from symphys.solvers import TraceRow
    from symphys.solvers.core.budget import BudgetUse

MANY_PAIRS = 50
"""Pairs of surfaces above which a warning is printed."""
SECONDS_PER_PAIR = 0.3
"""[s] to build a problem, for each pair of surfaces; measured with heaps of 8 and 16 spheres."""
LAST_LINES = 5
"""Lines of the log of a failed run that are shown."""


def many_pairs(name: str, pairs: int) -> str:
    """Return a warning for a world with many pairs of surfaces; empty for others."""
    if pairs <= MANY_PAIRS:
        return ""
    return (
        f"{name}: {pairs} pairs of surfaces may meet; each is computed in every step, and building takes about "
        f"{SECONDS_PER_PAIR * pairs:.0f} s. `collides_with` leaves out those that never meet"
    )


def number(value: float | None, digits: int = 3) -> str:
    """Return a short number; a dash for an unknown one."""
    if value is None or math.isnan(value):
        return "-"
    return f"{value:.{digits}g}"


def measured(value: float, unit: str) -> str:
    """Return a short number with its unit, if there is one."""
    return " ".join(filter(None, (number(value), unit)))


def labelled(name: str, value: float | None) -> str:
    """Return a number with its name and unit, which a name such as ``speed [m/s]`` holds."""
    what, unit = name[:-1].rsplit(" [", 1) if name.endswith("]") and " [" in name else (name, "")
    return " ".join(filter(None, [what, number(value), unit]))


def whole(value: float | None) -> str:
    """Return a count; a dash for an unknown one."""
    return "-" if value is None or not math.isfinite(value) else f"{value:,.0f}"


def duration(seconds: float | None) -> str:
    """Return seconds in a few digits."""
    if seconds is None:
        return "-"
    return f"{seconds:,.0f}" if seconds >= 100 else f"{seconds:.3g}"


def timed(seconds: float | None) -> str:
    """Return a time with its unit; a dash for an unknown one."""
    return "-" if seconds is None else f"{duration(seconds)} s"


def time_words(seconds: float) -> str:
    """Return a time to wait, rounded up, in a suitable unit."""
    if seconds <= 100:
        return f"{math.ceil(seconds)} s"
    return f"{math.ceil(seconds / 60)} min" if seconds <= 6000 else f"{seconds / 3600:.1f} h"


def brief(job: Job, result: Result, skipped: bool) -> str:
    """Return one line on a run that is over."""
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
    """Return the verdict of a run in words."""
    from symphys.findings.verdict import verdict_words

    return verdict_words(result.verdict, result.status, bool(result.checks))


def first_line(text: str) -> str:
    """Return the first line of a message."""
    return text.partition("\n")[0]


def at(row: TraceRow) -> str:
    """Return the iteration of a run in words, with the smoothing if there is any, since its numbers are not exact."""
    smoothed = f" at smoothing {row.smoothing:g}" if row.smoothing > 0 else ""
    outputs = "".join(f", {labelled(name, value)}" for name, value in row.outputs.items())
    now = f" (now {number(row.objective)})" if number(row.objective) != number(row.best) else ""
    numbers = f"objective {number(row.best)}{now}, worst {number(row.max_violation)}"
    return f"iteration {row.iteration}, {numbers}{outputs}{smoothed}"


def percent(share: float) -> str:
    """Return a share in percent, rounded down, so that unfinished work is never 100 %."""
    return f"{math.floor(100 * share + 1e-9)} %"


def use_words(use: BudgetUse) -> str:
    """Return the share of a run's budget that is used, and the most time left to solve; empty without a bound.

    The judging of its result is no part of it.
    """
    left = f"at most {time_words(use.seconds_left)} of solving left" if math.isfinite(use.seconds_left) else ""
    share = "" if math.isnan(use.share) else f"{percent(use.share)} of its budget"
    return ", ".join(filter(None, (share, left)))


def step_words(steps: StepProgress) -> str:
    """Return the present part, the share that is done, and about how long the rest takes."""
    left = f", about {time_words(steps.seconds_left)} left" if math.isfinite(steps.seconds_left) else ""
    return f"{steps.what}: {percent(steps.share)} done{left}"


def batch_words(batch: BatchShare) -> str:
    """Return how many runs are done, with share, time left, failures, and the best run of one problem."""
    text = f"{batch.over} of {batch.runs} runs done"
    if batch.runs == 1 or batch.over == batch.runs:
        return text
    left = f", about {time_words(batch.seconds_left)} left" if math.isfinite(batch.seconds_left) else ""
    failed = f", {batch.failed} failed" if batch.failed else ""
    best = f", best {number(batch.best[0])} by {batch.best[1]}" if batch.best and len(batch.problems) == 1 else ""
    return f"{text}, {percent(batch.share)} of all{left}{failed}{best}"


def waiting_words(batch: BatchShare, seconds: float) -> dict[str, str]:
    """Return words on runs that are judged, or had no news for ``seconds``, by their names."""
    quiet = {name: quiet_words(batch.running[name], time) for name, time in batch.quiet(seconds).items()}
    return quiet | {name: judging_words(steps) for name, steps in batch.judged.items()}


def quiet_words(use: BudgetUse, seconds: float) -> str:
    """Return words on a run that has had no news for so long."""
    if use.row is None:
        return f"building and compiling for {time_words(seconds)}"
    return f"no new iteration for {time_words(seconds)}; {at(use.row)}"


def judging_words(steps: StepProgress) -> str:
    """Return words on a run that is judged."""
    return f"judging what it found: {step_words(steps)}"


def log_end(job: Job) -> list[str]:
    """Return the last lines of the log of a run; none if there is no log."""
    with contextlib.suppress(files.FileError):
        text = files.read_text(job.folder.path / "log.txt")
        return [f"    {line}" for line in text.splitlines()[-LAST_LINES:]]
    return []
