"""Numbers and states in plain words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from symphys.findings.numerics import unfelt
from symphys.findings.verdict import BEST_FOUND, DOUBTED, INTERRUPTED, SOLVED, ending, verdict_words
from symphys.findings.writing import capital, listed, plain, show
from symphys.results.config import settings_words
from symphys.results.result import CheckRecord
from symphys.results.run import Run


def count(value: float) -> str:
    """Return a count in full; medians of an even number of counts may end in a half."""
    return plain(value, 1) if math.isfinite(value) else show(value)


def seconds(value: float) -> str:
    """Return a duration with a unit that suits it."""
    if math.isnan(value) or math.isinf(value):
        return show(value)
    if value < 0.0995:
        return f"{show(1000 * value, 2)} ms"
    return f"{show(value, 3)} s" if value < 600 else f"{show(value / 60, 3)} min"


def came_to(run: Run) -> str:
    """Say in a few words how a run ended: as its solver did, or its verdict, where that says more."""
    if run.verdict in (DOUBTED, BEST_FOUND):
        return verdict_words(run.verdict, run.status, bool(run.checks))
    return ending(run.status).brief_words


def level(run: Run) -> str:
    """Return ``good``, ``fair`` (nothing went wrong, but not solved) or ``bad``."""
    if run.solved:
        return "good"
    if run.verdict == DOUBTED:
        return "bad"
    return "bad" if ending(run.status).faulty else "fair"


def headline(run: Run) -> str:
    """Return a few words for a run."""
    if run.verdict in (SOLVED, DOUBTED, BEST_FOUND):
        return capital(verdict_words(run.verdict, run.status, bool(run.checks)))
    return ending(run.status).headline


def verdict(run: Run) -> str:
    """Say in one or two sentences what came out; the solver's own advice is separate."""
    if not run.readable:
        return "No result could be read from this folder."
    missed = [check for check in run.checks if not check.met]
    if run.status == "not_applicable":
        return f"{run.solver} does not apply to this problem."
    if run.verdict == INTERRUPTED:
        return ending(run.status).sentence
    if not run.checks and ending(run.status).sentence and math.isnan(run.objective):
        return f"{ending(run.status).sentence} There is nothing to judge."
    if not run.checks:
        text = (
            "The problem has no targets or constraints; the objective is "
            f"{show(run.objective)}. {ending(run.status).sentence}"
        )
    elif run.verdict in (SOLVED, DOUBTED):
        total = "The only check is" if len(run.checks) == 1 else f"All {len(run.checks)} checks are"
        text = f"{total} met; the largest error is {show(run.worst_ratio, 2)} of its tolerance{work(run)}."
        text += f" {ending(run.status).sentence}" if run.status == "interrupted" else ""
    else:
        text = f"{misses(missed, len(run.checks))} {how_it_ended(run)}"
    return f"{text.strip()} {doubted(run)}".strip()


def setting_title(run: Run) -> str:
    """Name a run of a sweep by its settings, solver and seed."""
    return f"{settings_words(run.settings)}, {run.solver}, seed {run.seed}"


def how_it_ended(run: Run) -> str:
    """Say how the solver ended; of one that never left its guess since nothing moves it there, that."""
    gradient = run.examination.gradient
    if run.iterations <= 1 and gradient and all(unfelt(check) for check in gradient):
        return "The gradient is zero at the guess, so the solver had nowhere to go."
    return ending(run.status).sentence


def next_step(run: Run) -> str:
    """Return the solver's advice; of a solved run whose budget ended, what more of it is for."""
    if run.solved and run.status == "budget" and run.advice:
        return f"The budget was spent; a larger budget may lower the costs ({run.advice})."
    return run.advice


def doubted(run: Run) -> str:
    """Say why a run is not to be relied on; empty where it is, or where it came to nothing anyway."""
    return f"But it is not to be relied on: {'; '.join(run.doubts)}." if run.verdict == DOUBTED else ""


def misses(missed: Sequence[CheckRecord], total: int) -> str:
    """Say how many checks are missed, and the worst by name."""
    if not missed:
        return "The run did not end as solved, though no check is missed."
    worst = max(missed, key=lambda check: math.inf if math.isnan(check.ratio) else check.ratio)
    many = (
        "The only check is" if total == 1 else f"{len(missed)} of {total} checks {'is' if len(missed) == 1 else 'are'}"
    )
    if not math.isfinite(worst.ratio):
        return f"{many} missed; the error of “{worst.name}” is not a finite number."
    return f"{many} missed; the worst is “{worst.name}” at {show(worst.ratio, 2)} times its tolerance."


def work(run: Run) -> str:
    """Say what a solve took."""
    counts = [(kind, run.counts.get(kind, 0.0)) for kind in ("rollouts", "gradients")]
    parts = [f"{count(number)} {kind}" for kind, number in counts if number > 0]
    took = run.seconds.get("solve", math.nan)
    spent = f" in {seconds(took)}" if math.isfinite(took) else ""
    return f", after {listed(parts)}{spent}" if parts else ""
