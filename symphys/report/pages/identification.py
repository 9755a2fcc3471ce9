"""The page of an identification: what `symphys identify` writes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D

from symphys import files
from symphys.findings.writing import capital, percent, several, show
from symphys.report.charts.chart import Chart, Key, Line, Panel
from symphys.report.charts.drawing import chart_pictures
from symphys.report.figures import style
from symphys.report.figures.data import TIME, DataFigure, keep
from symphys.report.making.stamps import FULL, RUN_PAGE, Stamp, folder_digest
from symphys.report.pages.markup import Html, banner, card, facts, join, named_figure, page, pill, stats, table, tag
from symphys.report.scene.animation import animation
from symphys.report.scene.ghosts import with_ghosts
from symphys.results.file_names import FIGURES, SCENE
from symphys.results.identification import (
    HISTORY,
    IDENTIFICATION,
    Identification,
    ParameterEstimate,
    PredictionErrors,
    read_identification,
)
from symphys.results.identification.replays import RecordingReplay, read_replays
from symphys.results.scene import Scene, read_scene
from symphys.types import Array

INTERVALS = (
    "An interval from the Jacobian holds if what is left is noise. One from the bootstrap draws whole recordings, and "
    "is the wider one where recordings differ by more than noise."
)
GHOST = "What was measured is seen through; what is simulated with the estimates is solid."
STRONG_CORRELATION = 0.9
"""Correlations that are named."""
MOST_NAMES = 30
"""Numbers of which a figure shows correlations and intervals."""
MOST_PANELS = 6
POINTS = 4000
"""Residuals that are drawn of a quantity."""
BINS = 40
"""Spans of time of which a figure shows the mean residual."""


def write_identification_page(folder: Path) -> Path:
    """Write the page of an identification from the files of its folder, and its figures as SVG and CSV beside it.

    Raises:
        ReportError: a file cannot be read or written.
    """
    digest = folder_digest(folder)
    found, replays = read_identification(folder), read_replays(folder)
    scene = read_scene(folder / SCENE) if replays else Scene()
    pictures = draw_pictures(found, replays)
    style.write_figures(folder / FIGURES, pictures.values())
    note = "Of the recordings fitted to."
    body = join(
        [
            tag("p", f"Identification · {found.problem}", class_="kicker"),
            tag("h1", found.title or found.problem),
            verdict(found),
            *(tag("p", f"Start: {each}.") for each in found.starts),
            numbers(found),
            card(
                "Estimates", estimates(found), named_figure(pictures, "intervals"), anchor="estimates", note=INTERVALS
            ),
            card("Unidentifiable parameters", unidentifiable(found), anchor="open"),
            card("Correlations", named_figure(pictures, "correlations"), strong(found), anchor="correlations"),
            card("Residual analysis", left(found), named_figure(pictures, "residuals"), anchor="left", note=note),
            card("Prediction", predictions(found), anchor="prediction"),
            *(worst(replay, scene, named_figure(pictures, f"replay-{k}")) for k, replay in enumerate(replays, 1)),
            card("The fit", named_figure(pictures, "course"), setting(found), anchor="fit"),
        ]
    )
    out, stamp = folder / RUN_PAGE, Stamp(FULL, digest)
    files.write_text(out, page(found.title or found.problem, body, animated=bool(replays), stamp=stamp))
    return out


def identification_folders(root: Path) -> list[Path]:
    """Return the folders at or below one that hold an identification."""
    return sorted(path.parent for path in root.rglob(IDENTIFICATION))


def verdict(found: Identification) -> Html:
    """Say how the fit ended, and what raises doubts."""
    if found.status != "converged":
        doubts = [each for each in found.doubts if found.reason not in each]
        return banner("bad", f"Not converged: {found.reason}", *doubts)
    if found.doubts:
        return banner("fair", f"Converged, with {several(len(found.doubts), 'doubt')}", *found.doubts)
    return banner("good", "Converged", f"{capital(found.reason)}.")


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
    """Return the cells of an estimate."""
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
    """Write an interval with as many digits as its width has a use for; empty where it is not known."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return ""
    half = max((high - low) / 2, 1e-12 * abs(value), 1e-300)
    digits = min(max(2 + math.ceil(math.log10(max(abs(low), abs(high), half) / half)), 3), 10)
    return f"{show(low, digits)} to {show(high, digits)}"


def unidentifiable(found: Identification) -> Html:
    """Directions without information, in words, and what recording would determine them."""
    if not found.open:
        return tag("p", "The recordings determine every number.")
    return join(tag("p", tag("b", f"{capital(each.text)}. "), f"{each.advice}.") for each in found.open)


def strong(found: Identification) -> Html:
    """Return the pairs that change together."""
    names, rows = [each.name for each in found.parameters], list[str]()
    for i, j in zip(*np.triu_indices(len(names), 1), strict=True):
        value = float(found.correlation[i, j])
        if abs(value) > STRONG_CORRELATION:
            rows.append(f"{names[i]} and {names[j]}: {show(value, 3)}")
    return tag("p", f"Strong: {'; '.join(rows)}.") if rows else Html("")


def left(found: Identification) -> Html:
    """Show the residuals that the fit leaves of each quantity, and their verdict."""
    header = ("quantity", "", "residual / noise", "rms", "noise", "from sample to sample", "why")
    rows = []
    for each in found.quantities:
        level = {"noise": "good", "missing effect": "bad"}.get(each.verdict, "unknown")
        noise = f"{show(each.noise)} {each.unit}" + ("" if each.noise_known else ", estimated")
        measures = show(each.ratio), f"{show(each.rms)} {each.unit}", noise, show(each.autocorrelation, 2)
        rows.append([tag("b", each.name), pill(level, each.verdict), *measures, each.text])
    return table(header, rows, "ttnnnnt", "Residuals") if rows else Html("")


def predictions(found: Identification) -> Html:
    """Show the errors of simulations against recordings that were fitted to, and against those held back."""
    rows = [error_row(kind, each) for kind, each in paired(found)]
    header = ("quantity", "recordings", "", "mean error", "standard deviation", "root mean square", "by noise")
    return table(header, rows, "ttnnnnn", "Errors of prediction") if rows else Html("")


def paired(found: Identification) -> list[tuple[str, PredictionErrors]]:
    """List errors by quantity, those of recordings held back after those fitted to."""
    back = {each.name: each for each in found.held_back_errors}
    both: list[tuple[str, PredictionErrors]] = []
    for each in found.fitted_errors:
        both.append(("fitted to", each))
        if each.name in back:
            both.append(("held back", back[each.name]))
    return both


def error_row(kind: str, each: PredictionErrors) -> list[str]:
    """Return the cells of an error."""
    values = [f"{show(each.mean)} {each.unit}", f"{show(each.deviation)} {each.unit}", f"{show(each.rmse)} {each.unit}"]
    values[1] = values[1] if math.isfinite(each.deviation) else ""
    return [tag("b", each.name), kind, f"{each.recordings}", *values, show(each.ratio)]


def worst(replay: RecordingReplay, scene: Scene, curves: Html) -> Html:
    """Return a recording played beside its simulation."""
    motion, both = with_ghosts(replay, scene)
    kind = "held back" if replay.held_back else "fitted to"
    note = f"{kind}; residuals {show(replay.ratio)} times the noise. {GHOST if replay.bodies else ''}"
    return card(f"Among the worst: {replay.name}", animation(motion, both), curves, note=capital(note))


def setting(found: Identification) -> Html:
    """Show the settings of the fit, and how other minima were looked for."""
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


def draw_pictures(found: Identification, replays: Sequence[RecordingReplay]) -> dict[str, style.Picture]:
    """Draw every figure of the page, by name; those that have nothing to show are left out."""
    charts = [course_chart(found), *(replay_chart(k, replay) for k, replay in enumerate(replays, 1))]
    with style.paper():
        made = style.picture("intervals", "Estimates with their intervals", draw_intervals(found))
        made += style.picture("correlations", "Correlations of the estimates", draw_correlations(found))
        made += style.picture("residuals", "Residuals over time", draw_residuals(found))
        made += chart_pictures(charts)
    return {picture.name: picture for picture in made}


def draw_intervals(found: Identification) -> DataFigure | None:
    """Each number with both of its intervals, in standard errors from the estimate."""
    known = [each for each in found.parameters if np.isfinite(each.error) and each.error > 0][:MOST_NAMES]
    if not known:
        return None
    figure = DataFigure(figsize=(style.WIDTH, 1.0 + 0.32 * len(known)), layout="constrained")
    axes = figure.subplots()
    rows = np.arange(len(known))[::-1]
    columns: dict[str, list[float]] = {}
    for row, each in zip(rows, known, strict=True):
        for low, high, colour, shift, name in (
            (each.lower, each.upper, style.BLUE, 0.14, "Jacobian"),
            (each.bootstrap_lower, each.bootstrap_upper, style.ORANGE, -0.14, "bootstrap"),
        ):
            ends = [(end - each.value) / each.error for end in (low, high)]
            axes.plot(ends, [row + shift] * 2, color=colour, linewidth=3, solid_capstyle="butt")
            for key, end in zip(("from", "to"), ends, strict=True):
                columns.setdefault(f"{name} {key} [standard errors]", []).append(end)
        if np.isfinite(each.prior_deviation):
            axes.plot((each.prior_mean - each.value) / each.error, row, "d", color=style.SOFT, markersize=4)
    axes.axvline(0.0, color=style.INK, linewidth=0.8)
    axes.set_yticks(rows, [each.name for each in known])
    axes.set_ylim(-0.7, len(known) - 0.3)
    axes.grid(visible=False, axis="y")
    style.set_linear(axes, "x", 8)
    axes.set_xlabel("from the estimate [standard errors]")
    keep(axes, {name: np.array(values) for name, values in columns.items()})
    names = ["95 % by the Jacobian"] + ["95 % by the bootstrap"] * (len(found.draws) > 0)
    handles = [Line2D([], [], color=colour, linewidth=3) for colour in (style.BLUE, style.ORANGE)[: len(names)]]
    style.legend_above(figure, handles, names)
    return figure


def draw_correlations(found: Identification) -> DataFigure | None:
    """Draw the correlations of the shared numbers."""
    names = [each.name for each in found.parameters][:MOST_NAMES]
    if len(names) < 2 or not np.isfinite(found.correlation).any():
        return None
    shown = found.correlation[: len(names), : len(names)]
    side = min(1.6 + 0.36 * len(names), style.WIDTH)
    figure = DataFigure(figsize=(style.WIDTH, side), layout="constrained")
    axes = figure.subplots()
    image = axes.imshow(shown, cmap="RdBu_r", vmin=-1, vmax=1)
    axes.set_xticks(range(len(names)), names, rotation=60, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(names)), names)
    axes.grid(visible=False)
    if len(names) <= 12:
        for (i, j), value in np.ndenumerate(shown):
            if np.isfinite(value) and i != j:
                colour = "white" if abs(value) > 0.6 else style.INK
                axes.text(
                    j, i, style.number_label(round(float(value), 2)), ha="center", va="center", color=colour, fontsize=7
                )
    figure.colorbar(image, ax=axes, shrink=0.8).outline.set_visible(False)
    keep(axes, {name: shown[:, k] for k, name in enumerate(names)})
    return figure


def draw_residuals(found: Identification) -> DataFigure | None:
    """Residuals by noise over time, of what was fitted to, with their running mean."""
    if not found.quantities:
        return None
    shown = list(range(len(found.quantities)))[:MOST_PANELS]
    figure = DataFigure(figsize=(style.WIDTH, 0.8 + 1.6 * len(shown)), layout="constrained")
    grid = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    back = np.asarray(found.held_back, bool)[np.asarray(found.residual_recording, int)]
    for axes, q in zip(grid, shown, strict=True):
        mine = (np.asarray(found.residual_quantity, int) == q) & ~back
        time, value = found.residual_time[mine], found.residual[mine]
        few = np.linspace(0, len(time) - 1, min(len(time), POINTS)).astype(int) if len(time) else np.zeros(0, int)
        axes.plot(time[few], value[few], ".", color=style.SKY, markersize=1.6, alpha=0.6, rasterized=True)
        keep(axes, {TIME: time[few], f"{found.quantities[q].name} by noise": value[few]})
        middle, mean, deviation = _binned(time, value)
        axes.fill_between(middle, mean - deviation, mean + deviation, color=style.FAINT, alpha=0.35, linewidth=0)
        axes.plot(middle, mean, color=style.VERMILION, linewidth=1.4)
        axes.axhline(0.0, color=style.INK, linewidth=0.7)
        axes.set_title(f"{found.quantities[q].name}: {found.quantities[q].verdict}")
        reach = float(np.quantile(np.abs(value), 0.995)) if len(value) else 1.0
        axes.set_ylim(-max(reach, 2.0) * 1.1, max(reach, 2.0) * 1.1)
        style.set_linear(axes, "y", 4)
    style.set_linear(grid[-1], "x", 8)
    grid[-1].set_xlabel(TIME)
    handles = [Line2D([], [], color=style.SKY, marker=".", linestyle=""), Line2D([], [], color=style.VERMILION)]
    style.legend_above(figure, handles, ["residuals by noise", "their mean, and where two thirds lie"])
    return figure


def course_chart(found: Identification) -> Chart | None:
    """Chart the merit, and how many standard errors are left, by iteration; None without two iterations."""
    history = np.asarray(found.history, float).reshape(-1, len(HISTORY))
    if len(history) < 2:
        return None
    panels, iteration, columns = list[Panel](), history[:, 0], dict(zip(HISTORY, history.T, strict=True))
    for name, title in (("merit", "Merit"), ("left", "Standard errors that are left")):
        scale = -1.0 if np.any(columns[name] > 0) else 0.0
        panels.append(Panel(title, (Line(name, style.BLUE, iteration, columns[name]),), "iteration", scale))
    table = {name: columns[name] for name in ("iteration", "merit", "left")}
    return Chart("course", "The course of the fit", tuple(panels), 2, tables=(table,), height=2.2)


def replay_chart(number: int, replay: RecordingReplay) -> Chart | None:
    """Chart what was measured and what is simulated, over time; None without a quantity."""
    panels, tables = list[Panel](), []
    for each in replay.quantities[:MOST_PANELS]:
        drawn, several_ = list[Line](), each.measured.shape[1] > 1
        for m, (measured, simulated) in enumerate(zip(each.measured.T, each.simulated.T, strict=True)):
            colour = style.AXES[m % len(style.AXES)] if several_ else style.BLUE
            drawn.append(Line("measured", colour, replay.time, measured, look="points"))
            drawn.append(Line("simulated", colour, replay.time, simulated, 1.2, "plain"))
            label = f" {m + 1}" if several_ else ""
            tables.append({TIME: replay.time, f"measured{label}": measured, f"simulated{label}": simulated})
        panels.append(Panel(f"{each.name} [{each.unit}]" if each.unit else each.name, tuple(drawn), TIME))
    keys = Key("measured", style.SOFT, "points"), Key("simulated", style.SOFT)
    alt = f"{replay.name}, measured and simulated"
    return Chart(f"replay-{number}", alt, tuple(panels), 1, keys, tuple(tables), 1.6) if panels else None


def _binned(time: Array, value: Array) -> tuple[Array, Array, Array]:
    """Middles of spans of time, and mean and deviation of the values in them."""
    if not len(time):
        return np.zeros(0), np.zeros(0), np.zeros(0)
    edges = np.linspace(time.min(), time.max() + 1e-12, BINS + 1)
    places = np.clip(np.digitize(time, edges) - 1, 0, BINS - 1)
    count = np.bincount(places, minlength=BINS)
    kept = count > 0
    mean = np.bincount(places, value, BINS)[kept] / count[kept]
    square = np.bincount(places, value**2, BINS)[kept] / count[kept]
    return (edges[:-1] + edges[1:])[kept] / 2, mean, np.sqrt(np.maximum(square - mean**2, 0.0))
