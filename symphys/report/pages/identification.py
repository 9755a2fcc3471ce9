"""The page of an identification: what `symphys identify` writes."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from symphys import files
from symphys.findings.writing import percent, several, show
from symphys.report.figures import style
from symphys.report.figures.identification import (
    draw_correlations,
    draw_course,
    draw_intervals,
    draw_replay,
    draw_residuals,
)
from symphys.report.making.stamps import FULL, RUN_PAGE, Stamp, folder_digest
from symphys.report.pages.markup import Html, banner, card, facts, figures, join, page, pill, stats, table, tag
from symphys.report.scene.animation import animation
from symphys.report.scene.ghosts import with_ghosts
from symphys.results.file_names import FIGURES, SCENE
from symphys.results.identification import (
    IDENTIFICATION,
    Identification,
    ParameterEstimate,
    PredictionErrors,
    read_identification,
)
from symphys.results.identification.replays import RecordingReplay, read_replays
from symphys.results.scene import Scene, read_scene

INTERVALS = (
    "An interval from the Jacobian holds if what is left is noise. One from the bootstrap draws whole recordings, and "
    "is the wider one where recordings differ by more than noise."
)
GHOST = "What was measured is seen through; what is simulated with the estimates is solid."
STRONG = 0.9
"""Correlations that are named."""


def write_identification_page(folder: Path) -> Path:
    """Write the page of an identification from the files of its folder, and its figures as SVG and CSV beside it.

    Raises:
        ReportError: a file cannot be read or written.
    """
    digest = folder_digest(folder)
    found, replays = read_identification(folder), read_replays(folder)
    scene = read_scene(folder / SCENE) if replays else Scene()
    drawn = {
        "intervals": ("Estimates with their intervals", draw_intervals, found),
        "correlations": ("Correlations of the estimates", draw_correlations, found),
        "residuals": ("Residuals over time", draw_residuals, found),
        "course": ("The course of the fit", draw_course, found),
    }
    with style.paper():
        made = [each for name, (alt, draw, of) in drawn.items() for each in style.picture(name, alt, draw(of))]
        for k, replay in enumerate(replays, 1):
            made += style.picture(f"replay-{k}", f"{replay.name}, measured and simulated", draw_replay(replay))
    pictures = {picture.name: picture for picture in made}
    style.write_figures(folder / FIGURES, made)

    def shown(name: str) -> Html:
        return figures([pictures[name]]) if name in pictures else Html("")

    body = join(
        [
            tag("p", f"Identification · {found.problem}", class_="kicker"),
            tag("h1", found.title or found.problem),
            verdict(found),
            *(tag("p", f"Start: {each}.") for each in found.starts),
            numbers(found),
            card("Estimates", estimates(found), shown("intervals"), anchor="estimates", note=INTERVALS),
            card("What is not determined", opened(found), anchor="open"),
            card("Correlations", shown("correlations"), strong(found), anchor="correlations"),
            card("What is left", left(found), shown("residuals"), anchor="left", note="Of the recordings fitted to."),
            card("Prediction", predictions(found), anchor="prediction"),
            *(worst(replay, scene, shown(f"replay-{k}")) for k, replay in enumerate(replays, 1)),
            card("The fit", shown("course"), setting(found), anchor="fit"),
        ]
    )
    out, stamp = folder / RUN_PAGE, Stamp(FULL, digest)
    files.write_text(out, page(found.title or found.problem, body, animated=bool(replays), stamp=stamp))
    return out


def identification_folders(root: Path) -> list[Path]:
    """The folders at or below one that hold an identification."""
    return sorted(path.parent for path in root.rglob(IDENTIFICATION))


def verdict(found: Identification) -> Html:
    """How the fit ended, and what raises doubts."""
    if found.status != "converged":
        doubts = [each for each in found.doubts if found.reason not in each]
        return banner("bad", f"Not converged: {found.reason}", *doubts)
    if found.doubts:
        return banner("fair", f"Converged, with {several(len(found.doubts), 'doubt')}", *found.doubts)
    return banner("good", "Converged", f"{found.reason[:1].upper()}{found.reason[1:]}.")


def numbers(found: Identification) -> Html:
    """Key numbers."""
    back = int(np.sum(found.held_back))
    ratio = math.sqrt(float(np.mean(np.square(found.residual)))) if len(found.residual) else math.nan
    return stats(
        [
            ("recordings", f"{len(found.recordings) - back}"),
            ("held back", f"{back}"),
            ("residuals", f"{found.residual_count}"),
            ("shared numbers", f"{len(found.parameters)}"),
            ("residual / noise", show(ratio, 3)),
            ("time", f"{show(sum(found.seconds.values()), 3)} s"),
        ]
    )


def estimates(found: Identification) -> Html:
    """Each shared number with its intervals."""
    header = ("number", "estimate", "unit", "95 % by the Jacobian", "95 % by the bootstrap", "guess", "bounds, prior")
    return table(header, [estimate_row(each) for each in found.parameters], "tntttnt", "Estimates")


def estimate_row(each: ParameterEstimate) -> list[str]:
    """One of them."""
    open_ = not math.isfinite(each.error)
    by_jacobian = pill("bad", "not determined") if open_ else interval(each.lower, each.upper, each.value)
    if each.at_bound:
        by_jacobian = pill("fair", f"at its {each.at_bound} bound")
    limits = (
        [f"{show(each.least)} to {show(each.most)}"] if math.isfinite(each.least) or math.isfinite(each.most) else []
    )
    if math.isfinite(each.prior_deviation):
        limits.append(f"prior {show(each.prior_mean)} ± {show(each.prior_deviation)}")
    by_bootstrap = interval(each.bootstrap_lower, each.bootstrap_upper, each.value)
    estimate = tag("b", show(each.value, 5))
    return [tag("b", each.name), estimate, each.unit, by_jacobian, by_bootstrap, show(each.guess, 4), ", ".join(limits)]


def interval(low: float, high: float, value: float) -> str:
    """From .. to .., with as many digits as their distance has a use for; empty where it is not known."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return ""
    half = max((high - low) / 2, 1e-12 * abs(value), 1e-300)
    digits = min(max(2 + math.ceil(math.log10(max(abs(low), abs(high), half) / half)), 3), 10)
    return f"{show(low, digits)} to {show(high, digits)}"


def opened(found: Identification) -> Html:
    """Directions without information, in words, and what recording would determine them."""
    if not found.open:
        return tag("p", "The recordings determine every number.")
    return join(
        tag("p", tag("b", f"{each.text[:1].upper()}{each.text[1:]}. "), f"{each.advice}.") for each in found.open
    )


def strong(found: Identification) -> Html:
    """The pairs that change together."""
    names, rows = [each.name for each in found.parameters], list[str]()
    for i, j in zip(*np.triu_indices(len(names), 1), strict=True):
        value = float(found.correlation[i, j])
        if abs(value) > STRONG:
            rows.append(f"{names[i]} and {names[j]}: {show(value, 3)}")
    return tag("p", f"Strong: {'; '.join(rows)}.") if rows else Html("")


def left(found: Identification) -> Html:
    """What the fit leaves of each quantity, and what that is."""
    header = ("quantity", "", "residual / noise", "rms", "noise", "from sample to sample", "why")
    rows = []
    for each in found.quantities:
        level = {"noise": "good", "missing effect": "bad"}.get(each.verdict, "unknown")
        noise = f"{show(each.noise)} {each.unit}" + ("" if each.noise_known else ", estimated")
        measures = show(each.ratio), f"{show(each.rms)} {each.unit}", noise, show(each.autocorrelation, 2)
        rows.append([tag("b", each.name), pill(level, each.verdict), *measures, each.text])
    return table(header, rows, "ttnnnnt", "Residuals") if rows else Html("")


def predictions(found: Identification) -> Html:
    """How far simulations are from recordings, of those fitted to and of those held back."""
    rows = [error_row(kind, each) for kind, each in paired(found)]
    header = ("quantity", "recordings", "", "mean error", "standard deviation", "root mean square", "by noise")
    return table(header, rows, "ttnnnnn", "Errors of prediction") if rows else Html("")


def paired(found: Identification) -> list[tuple[str, PredictionErrors]]:
    """By quantity, those held back after those fitted to."""
    back = {each.name: each for each in found.held_back_errors}
    both: list[tuple[str, PredictionErrors]] = []
    for each in found.fitted_errors:
        both.append(("fitted to", each))
        if each.name in back:
            both.append(("held back", back[each.name]))
    return both


def error_row(kind: str, each: PredictionErrors) -> list[str]:
    """One of them."""
    values = [f"{show(each.mean)} {each.unit}", f"{show(each.deviation)} {each.unit}", f"{show(each.rmse)} {each.unit}"]
    values[1] = values[1] if math.isfinite(each.deviation) else ""
    return [tag("b", each.name), kind, f"{each.recordings}", *values, show(each.ratio)]


def worst(replay: RecordingReplay, scene: Scene, curves: Html) -> Html:
    """A recording played beside its simulation."""
    motion, both = with_ghosts(replay, scene)
    kind = "held back" if replay.held_back else "fitted to"
    note = f"{kind}; residuals {show(replay.ratio)} times the noise. {GHOST if replay.bodies else ''}"
    return card(
        f"Among the worst: {replay.name}", animation(motion, both), curves, note=f"{note[:1].upper()}{note[1:]}"
    )


def setting(found: Identification) -> Html:
    """How it was made, and how other minima were looked for."""
    loss = "squares" if math.isinf(found.threshold) else f"Huber's, beyond {show(found.threshold)} standard deviations"
    parts = ", ".join(f"{name} {show(seconds)} s" for name, seconds in found.seconds.items() if seconds > 0)
    work = [f"{several(int(count), name[:-1])}" for name, count in found.evaluations.items()]
    rows: list[tuple[str, str]] = [
        ("Loss", loss),
        ("Merit", f"{show(found.merit, 6)} of {found.residual_count} residuals, {found.freedom} degrees of freedom"),
        ("Time", parts),
        ("Work", ", ".join(work) + ", of single recordings"),
    ]
    if found.bootstrap_note:
        rows.append(("Bootstrap", found.bootstrap_note))
    if found.search is not None:
        rows.append(("Other minima", found.search.text))
    strongest = [name for name, ratio in found.worst(5) if ratio > 0]
    rows.append(("Largest residuals", ", ".join(strongest)))
    share = float(np.mean(np.abs(found.residual) > 3)) if len(found.residual) else 0.0
    rows.append(("Beyond three deviations", percent(share)))
    return facts(rows)
