"""Numbers and states in plain words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from symphys.report.records import Check, Run

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
MINUS = "\N{MINUS SIGN}"
DASH = "\N{EN DASH}"
THIN = "\N{NARROW NO-BREAK SPACE}"

STATUS = {
    "met": "every target met",
    "converged": "converged",
    "budget": "budget spent",
    "stalled": "no more progress",
    "not_finite": "a number was not finite",
    "not_applicable": "not applicable",
    "failed": "failed",
    "interrupted": "interrupted",
    "unreadable": "no readable result",
}

STOPPED = {
    "converged": "The solver converged to a point that misses them.",
    "budget": "The solver's budget was spent.",
    "stalled": "The solver could make no more progress.",
    "not_finite": "A number in the simulation was not finite.",
    "failed": "The solver failed.",
}


def show(value: float, digits: int = 3) -> str:
    """A number with ``digits`` significant digits, as people write it; a dash for nan."""
    if math.isnan(value):
        return DASH
    if math.isinf(value):
        return "∞" if value > 0 else MINUS + "∞"
    text = f"{value:.{digits - 1}e}"
    mantissa, exponent = float(text[: text.index("e")]), int(text[text.index("e") + 1 :])
    if value == 0 or -4 < exponent < 6:
        return plain(float(text), max(digits - 1 - exponent, 0) if value else 0)
    return sign(f"{mantissa:g}" if mantissa not in (1, -1) else f"{mantissa:.0f}") + f" × 10{power(exponent)}"  # noqa: RUF001


def percent(share: float) -> str:
    """A share >= 0 in percent; a dash for nan."""
    if not math.isfinite(share):
        return show(share)
    return f"{show(100 * share, 2)} %" if share == 0 or share >= 1e-6 else "< 0.0001 %"


def plain(value: float, decimals: int) -> str:
    """Without an exponent; trailing zeros after the point go, thousands are set apart from 10 000 on."""
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    if abs(value) >= 10_000:
        whole, point, rest = text.partition(".")
        text = f"{int(whole):,}".replace(",", THIN) + point + rest
    return sign("0" if text == "-0" else text)


def sign(text: str) -> str:
    """A true minus sign."""
    return text.replace("-", MINUS)


def power(exponent: int) -> str:
    """An exponent in superscripts."""
    return str(exponent).translate(SUPERSCRIPTS)


def count(value: float) -> str:
    """A count in full; medians of an even number of counts may end in a half."""
    return plain(value, 1) if math.isfinite(value) else show(value)


def seconds(value: float) -> str:
    """A duration with a unit that suits it."""
    if math.isnan(value) or math.isinf(value):
        return show(value)
    if value < 0.0995:
        return f"{show(1000 * value, 2)} ms"
    return f"{show(value, 3)} s" if value < 600 else f"{show(value / 60, 3)} min"


def several(number: int, noun: str, plural: str = "") -> str:
    """``1 run``, ``3 runs``."""
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def listed(parts: Sequence[str]) -> str:
    """``a``, ``a and b``, ``a, b and c``."""
    return " and ".join([", ".join(parts[:-1]), parts[-1]]) if len(parts) > 1 else "".join(parts)


def status(code: str) -> str:
    """A status in plain words; one that is not known is told as it stands."""
    return STATUS.get(code, code.replace("_", " ") or "no status")


def ended(code: str) -> str:
    """A status in two words at most, for tables."""
    return {"met": "met", "not_finite": "not finite"}.get(code, status(code))


def level(run: Run) -> str:
    """``good``, ``fair`` (nothing went wrong, but not solved) or ``bad``."""
    if run.solved:
        return "good"
    return "bad" if run.status in ("failed", "not_finite", "unreadable", "") else "fair"


def headline(run: Run) -> str:
    """Two words for a run."""
    if run.solved:
        return "Solved"
    known = {"interrupted": "Interrupted", "not_applicable": "Not applicable", "failed": "Failed"}
    return known.get(run.status, "Not solved" if run.readable else "No result")


def verdict(run: Run) -> str:
    """What came out, in one or two sentences; the solver's own advice is told apart."""
    if not run.readable:
        return "No result could be read from this folder."
    missed = [check for check in run.checks if not check.met]
    if run.status == "not_applicable":
        return f"{run.solver} does not apply to this problem."
    if run.status == "interrupted":
        return "The run was interrupted; the same command goes on from where it stopped."
    if not run.checks and run.status in STOPPED and math.isnan(run.objective):
        return f"{STOPPED[run.status]} There is nothing to judge."
    if not run.checks:
        return f"The problem states no targets; the objective is {show(run.objective)}." + stopped(run)
    if run.solved:
        total = "The only check is" if len(run.checks) == 1 else f"All {len(run.checks)} checks are"
        return f"{total} met; the largest error is {show(run.worst, 2)} of its tolerance{work(run)}."
    return f"{misses(missed, len(run.checks))} {STOPPED.get(run.status, '')}".strip()


def stopped(run: Run) -> str:
    """How a run without targets ended, where that is bad news."""
    return f" Status: {status(run.status)}." if run.status not in ("met", "converged") else ""


def misses(missed: Sequence[Check], total: int) -> str:
    """How many checks are missed, and the worst by name."""
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
    """What a solve took."""
    counts = [(kind, run.effort.counts.get(kind, 0.0)) for kind in ("rollouts", "gradients")]
    parts = [f"{count(number)} {kind}" for kind, number in counts if number > 0]
    took = run.effort.seconds.get("solve", math.nan)
    spent = f" in {seconds(took)}" if math.isfinite(took) else ""
    return f", after {listed(parts)}{spent}" if parts else ""
