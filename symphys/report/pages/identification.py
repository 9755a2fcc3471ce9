"""The page of an identification: what `symphys identify` writes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from symphys import files
from symphys.findings.writing import capital, percent, several, show
from symphys.report.charts import palette
from symphys.report.charts.chart import Bars, Chart, Key, Line, Panel
from symphys.report.charts.tables import TIME, Table
from symphys.report.making.stamps import RUN_PAGE, folder_digest
from symphys.report.pages.markup import Html, banner, card, facts, join, named_figure, page, pill, stats, table, tag
from symphys.report.scene.animation import animation
from symphys.report.scene.ghosts import with_ghosts
from symphys.results.file_names import SCENE
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
    "Jacobian intervals are valid if the residuals are noise. Bootstrap intervals resample whole recordings; they are "
    "wider if recordings differ by more than noise."
)
GHOST = "Measured bodies are transparent, bodies simulated with the estimates are solid."
MOST_ERRORS = 12.0
"""[standard errors] How far the bars of intervals go at most."""
WHITE_FROM = 0.6
"""Correlations from which a cell is so dark that its number is white."""
SHOWN = 0.995
"""Share of the residuals that the axis has room for."""
STRONG_CORRELATION = 0.9
"""Correlations that are named."""
MOST_NAMES = 30
"""Numbers of which a figure shows correlations and intervals."""
MOST_PANELS = 6
BINS = 40
"""Spans of time of which a figure shows the mean residual."""


def write_identification_page(folder: Path) -> Path:
    """Write the page of an identification from the files of its folder.

    Raises:
        ReportError: a file cannot be read or written.
    """
    digest = folder_digest(folder)
    found, replays = read_identification(folder), read_replays(folder)
    scene = read_scene(folder / SCENE) if replays else Scene()
    charts = {chart.name: chart for chart in every_chart(found, replays)}
    note = "Of the recordings fitted to."
    body = join(
        [
            tag("p", f"Identification · {found.problem}", class_="kicker"),
            tag("h1", found.title or found.problem),
            verdict(found),
            *(tag("p", f"Start: {each}.") for each in found.starts),
            numbers(found),
            card("Estimates", estimates(found), named_figure(charts, "intervals"), anchor="estimates", note=INTERVALS),
            card("Unidentifiable parameters", unidentifiable(found), anchor="open"),
            card("Correlations", correlations(found), strong(found), anchor="correlations"),
            card("Residual analysis", left(found), named_figure(charts, "residuals"), anchor="left", note=note),
            card("Prediction", predictions(found), anchor="prediction"),
            *(worst(replay, scene, named_figure(charts, f"replay-{k}")) for k, replay in enumerate(replays, 1)),
            card("The fit", named_figure(charts, "course"), setting(found), anchor="fit"),
        ]
    )
    files.write_text(folder / RUN_PAGE, page(found.title or found.problem, body, digest))
    return folder / RUN_PAGE


def write_identification_figures(folder: Path, out: Path) -> list[Path]:
    """Write the charts of the page of an identification as NAME.svg and NAME.csv into a folder; return the paths."""
    from symphys.report.figures.run import draw_figures  # late: it imports matplotlib
    from symphys.report.figures.style import write_figures

    charts = every_chart(read_identification(folder), read_replays(folder))
    return write_figures(out, draw_figures(charts, None, Scene()))


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


def correlations(found: Identification) -> Html:
    """Return the correlations of the shared numbers as a table of coloured cells; empty without two of them."""
    names = [each.name for each in found.parameters][:MOST_NAMES]
    if len(names) < 2 or not np.isfinite(found.correlation).any():
        return Html("")
    head = [tag("th", ""), *(tag("th", name, scope="col") for name in names)]
    cells = [[correlation_cell(float(value)) for value in row] for row in found.correlation[: len(names), : len(names)]]
    rows = [tag("tr", tag("th", name, scope="row"), *row) for name, row in zip(names, cells, strict=True)]
    content = tag("table", tag("thead", tag("tr", *head)), tag("tbody", *rows), class_="correlations")
    return tag("div", content, class_="scroll")


def correlation_cell(value: float) -> Html:
    """Return a cell: the stronger, the darker; red for what grows together, blue for what does not."""
    if not math.isfinite(value):
        return tag("td", "")
    colour = "178 24 43" if value > 0 else "33 102 172"
    ink = "; color: #fff" if abs(value) > WHITE_FROM else ""
    return tag("td", show(value, 2), style=f"background: rgb({colour} / {min(abs(value), 1):.2f}){ink}")


def every_chart(found: Identification, replays: Sequence[RecordingReplay]) -> list[Chart]:
    """Return every chart of the page; those that have nothing to show are left out."""
    charts = [interval_chart(found), residual_chart(found), course_chart(found)]
    charts += [replay_chart(k, replay) for k, replay in enumerate(replays, 1)]
    return [chart for chart in charts if chart is not None]


def interval_chart(found: Identification) -> Chart | None:
    """Chart both intervals and the prior of each number, in standard errors from the estimate."""
    known = [each for each in found.parameters if np.isfinite(each.error) and each.error > 0][:MOST_NAMES]
    if not known:
        return None
    bars, columns, used = list[Bars](), dict[str, list[float]](), dict[str, Key]()
    for each in known:
        name = each.name
        for kind, colour, low, high in (
            ("95 % by the Jacobian", palette.BLUE, each.lower, each.upper),
            ("95 % by the bootstrap", palette.ORANGE, each.bootstrap_lower, each.bootstrap_upper),
            ("prior", palette.FAINT, each.prior_mean - each.prior_deviation, each.prior_mean + each.prior_deviation),
        ):
            ends = [(end - each.value) / each.error for end in (low, high)]
            for key, end in zip(("from", "to"), ends, strict=True):
                columns.setdefault(f"{kind} {key} [standard errors]", []).append(end)
            if np.isfinite(ends).all():
                bars.append(Bars(name, colour, ((max(ends[0], -MOST_ERRORS), min(ends[1], MOST_ERRORS)),)))
                used[kind] = Key(kind, colour)
                name = ""
    if not bars:
        return None
    reach = 1.05 * max(abs(end) for bar in bars for end in bar.spans[0])
    title = "From the estimate [standard errors]"
    panel = Panel(title, least=(-reach, reach), bars=tuple(bars), end=(0.0, ""))
    table: dict[str, Any] = {"number": [each.name for each in known], **columns}
    height = 0.4 + 0.25 * len(bars)
    return Chart("intervals", "Estimates with their intervals", (panel,), 1, tuple(used.values()), (table,), height)


def residual_chart(found: Identification) -> Chart | None:
    """Chart residuals by noise over time, of what was fitted to, with their running mean."""
    back = np.asarray(found.held_back, bool)[np.asarray(found.residual_recording, int)]
    panels, tables = list[Panel](), list[Table]()
    for q, quantity in enumerate(found.quantities[:MOST_PANELS]):
        mine = (np.asarray(found.residual_quantity, int) == q) & ~back
        order = np.argsort(found.residual_time[mine], kind="stable")
        time, value = found.residual_time[mine][order], found.residual[mine][order]
        reach = 1.1 * max(float(np.quantile(np.abs(value), SHOWN)) if len(value) else 1.0, 2.0)
        beyond = int(np.sum(np.abs(value) > reach))
        middle, mean, deviation = _binned(time, value)
        drawn = [Line("", palette.SKY, time, np.where(np.abs(value) > reach, np.nan, value), look="points")]
        drawn += [Line("", palette.VERMILION, middle, mean + s * deviation, 1.0, "dotted") for s in (-1, 1)]
        drawn.append(Line("mean", palette.VERMILION, middle, mean, 1.4, "plain"))
        note, title = f"{beyond} beyond the axis" if beyond else "", f"{quantity.name}: {quantity.verdict}"
        panels.append(Panel(title, tuple(drawn), TIME, edges=(0.0,), least=(-reach, reach), note=note))
        tables.append({TIME: time, f"{quantity.name} by noise": value})
    keys = (
        Key("residuals by noise", palette.SKY, "points"),
        Key("their mean", palette.VERMILION),
        Key("where two thirds lie", palette.VERMILION, "dotted"),
    )
    if not panels:
        return None
    return Chart("residuals", "Residuals over time", tuple(panels), 1, keys, tuple(tables), 1.6, points=4000)


def course_chart(found: Identification) -> Chart | None:
    """Chart the merit, and how many standard errors are left, by iteration; None without two iterations."""
    history = np.asarray(found.history, float).reshape(-1, len(HISTORY))
    if len(history) < 2:
        return None
    panels, iteration, columns = list[Panel](), history[:, 0], dict(zip(HISTORY, history.T, strict=True))
    for name, title in (("merit", "Merit"), ("left", "Standard errors that are left")):
        scale = -1.0 if np.any(columns[name] > 0) else 0.0
        panels.append(Panel(title, (Line(name, palette.BLUE, iteration, columns[name]),), "iteration", scale))
    table = {name: columns[name] for name in ("iteration", "merit", "left")}
    return Chart("course", "The course of the fit", tuple(panels), 2, tables=(table,), height=2.2)


def replay_chart(number: int, replay: RecordingReplay) -> Chart | None:
    """Chart what was measured and what is simulated, over time; None without a quantity."""
    panels, tables = list[Panel](), []
    for each in replay.quantities[:MOST_PANELS]:
        drawn, several_ = list[Line](), each.measured.shape[1] > 1
        for m, (measured, simulated) in enumerate(zip(each.measured.T, each.simulated.T, strict=True)):
            colour = palette.AXES[m % len(palette.AXES)] if several_ else palette.BLUE
            drawn.append(Line("measured", colour, replay.time, measured, look="points"))
            drawn.append(Line("simulated", colour, replay.time, simulated, 1.2, "plain"))
            label = f" {m + 1}" if several_ else ""
            tables.append({TIME: replay.time, f"measured{label}": measured, f"simulated{label}": simulated})
        panels.append(Panel(f"{each.name} [{each.unit}]" if each.unit else each.name, tuple(drawn), TIME))
    keys = Key("measured", palette.SOFT, "points"), Key("simulated", palette.SOFT)
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
