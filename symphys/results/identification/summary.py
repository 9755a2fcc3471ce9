"""An identification as text for the terminal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symphys.results.identification.record import Identification, ParameterEstimate, PredictionErrors

STRONG_CORRELATION = 0.9
"""Correlation from which pairs are listed."""


def summary(found: Identification) -> str:
    """Return estimates, open directions, residuals, predictions and the course of the fit, as text of several lines."""
    parts = [
        heading(found),
        table(("", "estimate", "95 % interval", "bootstrap", ""), [parameter_row(each) for each in found.parameters]),
        "\n".join([*correlations(found), *own_lines(found)]),
        "\n".join(f"not determined: {each.text}\n  {each.advice}." for each in found.open),
        residuals(found),
        predictions("fitted to", found.fitted_errors),
        predictions("held back", found.held_back_errors),
        worst(found),
        found.search.text if found.search else "",
        "\n".join(f"start: {each}" for each in found.starts),
        f"bootstrap: {found.bootstrap_note}" if found.bootstrap_note else "",
        "\n".join(f"doubt: {each}" for each in found.doubts),
    ]
    return "\n\n".join(filter(None, parts)) + "\n"


def heading(found: Identification) -> str:
    """Describe how the fit ended, and its data."""
    back = int(np.sum(found.held_back))
    count = f"{len(found.recordings) - back} recordings" + (f", {back} more held back" if back else "")
    work = f"{max(len(found.history) - 1, 0)} iterations, {sum(found.seconds.values()):.3g} s"
    first = f"{found.title or found.problem}: {count}, {found.residual_count} residuals"
    return f"{first}\n{found.status}: {found.reason} ({work})"


def parameter_row(each: ParameterEstimate) -> tuple[str, ...]:
    """Return name, estimate, both intervals and remarks of a shared number."""
    digits = significant(each.value, each.error)
    value = f"{each.value:.{digits}g}" + (f" {each.unit}" if each.unit else "")
    open_ended = bool(np.isinf(each.error))
    lasting = "any" if open_ended else interval(each.lower, each.upper, digits)
    notes = [f"at its {each.at_bound} bound" if each.at_bound else "", "not determined" if open_ended else ""]
    if np.isfinite(each.prior_deviation):
        notes.append(f"prior {each.prior_mean:.4g} ± {each.prior_deviation:.2g}")
    return (
        each.name,
        value,
        lasting,
        interval(each.bootstrap_lower, each.bootstrap_upper, digits),
        ", ".join(filter(None, notes)),
    )


def significant(value: float, error: float) -> int:
    """Return the digits that show a number up to the second digit of its standard error."""
    if not (np.isfinite(error) and error > 0 and value != 0):
        return 6
    return int(np.clip(np.floor(np.log10(abs(value))) - np.floor(np.log10(error)) + 2, 2, 12))


def interval(lower: float, upper: float, digits: int) -> str:
    """Write ``0.17 to 0.19``; empty where unknown."""
    return "" if np.isnan(lower) or np.isnan(upper) else f"{lower:.{digits}g} to {upper:.{digits}g}"


def correlations(found: Identification) -> list[str]:
    """Describe pairs of shared numbers that the recordings hardly distinguish."""
    names = [each.name for each in found.parameters]
    pairs = [
        (names[i], names[j], float(found.correlation[i, j]))
        for i in range(len(names))
        for j in range(i)
        if abs(found.correlation[i, j]) > STRONG_CORRELATION
    ]
    return [f"{a} and {b} are correlated by {value:.3f}" for a, b, value in pairs]


def own_lines(found: Identification) -> list[str]:
    """Describe own numbers that recordings do not determine, or that a bound holds."""
    lines = []
    for j, name in enumerate(found.own_names):
        left, held = np.isinf(found.own_error[:, j]), found.own_at_bound[:, j] != 0
        for some, what in ((left, "is not determined"), (held, "is at a bound")):
            if some.any():
                first = found.recordings[int(np.flatnonzero(some)[0])]
                lines.append(f"{name} {what} in {int(some.sum())} of {len(some)} recordings, {first} the first")
    return lines


def residuals(found: Identification) -> str:
    """Write a table of the residuals of each quantity."""
    rows = [
        (
            each.name,
            with_unit(each.rms, each.unit),
            f"{each.ratio:.3g} of {'given' if each.noise_known else 'estimated'} {with_unit(each.noise, each.unit)}",
            f"{each.verdict}: {each.text}",
        )
        for each in found.quantities
    ]
    return table(("residuals", "rms", "by noise", ""), rows) if rows else ""


def predictions(what: str, errors: Sequence[PredictionErrors]) -> str:
    """Return a table of the errors of simulations against recordings."""
    rows = [
        (
            each.name,
            f"{each.mean:.4g}{spread(each.deviation)} {each.unit}".rstrip(),
            with_unit(each.rmse, each.unit),
            f"{each.ratio:.3g}",
        )
        for each in errors
    ]
    return table((f"{what} ({errors[0].recordings})", "mean error", "rmse", "by noise"), rows) if rows else ""


def spread(deviation: float) -> str:
    """Write `` ± 0.002``; empty where one recording has none."""
    return "" if np.isnan(deviation) else f" ± {deviation:.3g}"


def worst(found: Identification) -> str:
    """Return the recordings whose residuals are largest."""
    return "worst recordings: " + ", ".join(f"{name} ({ratio:.3g} times the noise)" for name, ratio in found.worst())


def with_unit(number: float, unit: str) -> str:
    """Write ``0.0021 m``."""
    return f"{number:.3g} {unit}".rstrip()


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Align columns."""
    lines = [list(head), *map(list, rows)]
    widths = [max(len(line[j]) for line in lines) for j in range(len(head))]
    return "\n".join(
        "  ".join(text.ljust(width) for text, width in zip(line, widths, strict=True)).rstrip() for line in lines
    )
