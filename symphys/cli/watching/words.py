"""What is said of work that goes on: shares done, times left, runs in a line."""

from __future__ import annotations

import contextlib
import math
from typing import TYPE_CHECKING

from symphys import files
from symphys.batches.progress import BatchShare, StepProgress
from symphys.cli.wording import labelled, number, time_words

if TYPE_CHECKING:
    from symphys.runs import Job
    from symphys.solvers import TraceRow
    from symphys.solvers.core.budget import BudgetUse

LAST_LINES = 5
"""Of the log of a run that failed."""


def at(row: TraceRow) -> str:
    """Where a run is; the smoothing only where there is some, as its numbers are not the exact ones then."""
    smoothed = f" at smoothing {row.smoothing:g}" if row.smoothing > 0 else ""
    outputs = "".join(f", {labelled(name, value)}" for name, value in row.outputs.items())
    return (
        f"iteration {row.iteration}, objective {number(row.best)}, worst {number(row.max_violation)}{outputs}{smoothed}"
    )


def percent(share: float) -> str:
    """Of what is to be done; rounded down, so that nothing is called done that is not."""
    return f"{math.floor(100 * share + 1e-9)} %"


def use_words(use: BudgetUse) -> str:
    """The share of its budget that a run has used, and the time that solving takes at most; empty without a bound.

    The judging of its result is no part of it.
    """
    left = f"at most {time_words(use.seconds_left)} of solving left" if math.isfinite(use.seconds_left) else ""
    share = "" if math.isnan(use.share) else f"{percent(use.share)} of its budget"
    return ", ".join(filter(None, (share, left)))


def step_words(steps: StepProgress) -> str:
    """What is done now, the share that is done, and about how long the rest takes."""
    left = f", about {time_words(steps.seconds_left)} left" if math.isfinite(steps.seconds_left) else ""
    return f"{steps.what}: {percent(steps.share)} done{left}"


def batch_words(batch: BatchShare) -> str:
    """How many runs are done; of several the share, the time that is left, failures, and the best of one problem."""
    text = f"{batch.over} of {batch.runs} runs done"
    if batch.runs == 1 or batch.over == batch.runs:
        return text
    left = f", about {time_words(batch.seconds_left)} left" if math.isfinite(batch.seconds_left) else ""
    failed = f", {batch.failed} failed" if batch.failed else ""
    best = f", best {number(batch.best[0])} by {batch.best[1]}" if batch.best and len(batch.problems) == 1 else ""
    return f"{text}, {percent(batch.share)} of all{left}{failed}{best}"


def waiting_words(batch: BatchShare, seconds: float) -> dict[str, str]:
    """Of the runs that are judged, or have brought no news for so long: what is said of them, by their names."""
    quiet = {name: quiet_words(batch.running[name], time) for name, time in batch.quiet(seconds).items()}
    return quiet | {name: judging_words(steps) for name, steps in batch.judged.items()}


def quiet_words(use: BudgetUse, seconds: float) -> str:
    """A run that has brought no news for so long."""
    if use.row is None:
        return f"building and compiling for {time_words(seconds)}"
    return f"no new iteration for {time_words(seconds)}; {at(use.row)}"


def judging_words(steps: StepProgress) -> str:
    """A run whose solver is done."""
    return f"judging what it found: {step_words(steps)}"


def log_end(job: Job) -> list[str]:
    """The last lines of the log of a run; none if there is no log."""
    with contextlib.suppress(files.FileError):
        text = files.read_text(job.folder.path / "log.txt")
        return [f"    {line}" for line in text.splitlines()[-LAST_LINES:]]
    return []
