"""The page of a closed loop: what `symphys mpc` writes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from symphys import files
from symphys.findings.writing import percent, show
from symphys.report.charts import palette
from symphys.report.charts.chart import Chart, Key, Line, Panel
from symphys.report.charts.motion import motion_charts
from symphys.report.charts.tables import TIME
from symphys.report.pages.markup import (
    Html,
    banner,
    card,
    facts,
    join,
    named_figure,
    page,
    pill,
    stats,
    table,
    tag,
)
from symphys.report.pages.motion import gait_card, joint_card, motion_card
from symphys.results.closed_loop import ClosedLoopRecord, read_closed_loop
from symphys.results.file_names import SCENE, TRAJECTORY
from symphys.results.scene import read_scene
from symphys.results.trajectories import read_trajectory
from symphys.types import Array

MOST_PANELS = 6
BINS = 60
"""Of the histogram of latencies."""
MIN_IN_TIME = 0.99
"""Share of ticks in time that counts as keeping up."""
LATE = (
    "A plan acts as soon as it is ready; until then the previous plan continues. Ticks that pass while the solver "
    "works count as late."
)


def write_closed_loop_page(folder: Path) -> Path:
    """Write the page of a closed loop from the files of its folder.

    Raises:
        ReportError: a file cannot be read or written.
    """
    record = read_closed_loop(folder)
    trajectory, scene = read_trajectory(folder / TRAJECTORY), read_scene(folder / SCENE)
    found = [*motion_charts(trajectory, scene), plans_chart(record), commands_chart(record), latency_chart(record)]
    charts = {chart.name: chart for chart in found if chart is not None}
    body = join(
        [
            tag("p", f"Closed loop · {record.problem}", class_="kicker"),
            tag("h1", record.title),
            verdict(record),
            numbers(record),
            card("Targets", targets(record), anchor="checks", note="Of the plant, at the end of the closed loop."),
            motion_card(trajectory, scene),
            card("Plans and what happened", named_figure(charts, "plans"), anchor="plans"),
            card("Commands", named_figure(charts, "commands"), anchor="commands"),
            card("Latency", named_figure(charts, "latencies"), anchor="latency", note=LATE),
            joint_card(trajectory, scene, charts),
            gait_card(trajectory, scene, charts),
            card("Setting", setting(record), anchor="provenance"),
        ]
    )
    out = folder / "report.html"
    files.write_text(out, page(record.title, body))
    return out


def verdict(record: ClosedLoopRecord) -> Html:
    """Say whether the task is done, and whether plans came in time."""
    if record.stopped:
        title, level = f"Stopped after {show(record.duration, 3)} s: {record.stopped}", "bad"
    elif not record.targets:
        title, level = f"Ran for {show(record.duration, 3)} s", "good"
    elif record.done:
        title, level = f"All targets are met at the end, and have been for {show(record.held, 3)} s", "good"
    else:
        missed = ", ".join(target.name for target in record.targets if not target.met)
        title, level = f"Not met at the end: {missed}", "bad"
    if level == "good" and record.share < MIN_IN_TIME:
        level = "fair"
    period = 1e3 / record.rate
    sentence = (
        f"{percent(record.share)} of {record.ticks} ticks had their plan within {show(period, 3)} ms; the median took "
        f"{show(1e3 * record.median, 3)} ms, the worst {show(1e3 * record.worst, 3)} ms."
    )
    return banner(level, title, sentence)


def numbers(record: ClosedLoopRecord) -> Html:
    """Key numbers."""
    return stats(
        [
            ("rate", f"{show(record.rate, 4)} Hz"),
            ("in time", percent(record.share)),
            ("median", f"{show(1e3 * record.median, 3)} ms"),
            ("99 %", f"{show(1e3 * record.p99, 3)} ms"),
            ("worst", f"{show(1e3 * record.worst, 3)} ms"),
            ("simulated", f"{show(record.duration, 4)} s"),
        ]
    )


def targets(record: ClosedLoopRecord) -> Html:
    """Each target with its error; nothing without any."""
    if not record.targets:
        return Html("")
    rows = [
        (
            each.name,
            pill("good", "met") if each.met else pill("bad", "missed"),
            show(each.error, 3),
            show(each.tolerance, 3),
            f"{show(each.held, 3)} s",
        )
        for each in record.targets
    ]
    return table(("target", "", "error", "tolerance", "met for"), rows, "ttnnn")


def setting(record: ClosedLoopRecord) -> Html:
    """Show the settings of the controller and of the plant."""
    plans = f"{show(record.horizon, 4)} s ahead in steps of {show(record.dt, 4)} s, {record.iterations} iteration"
    between = "feedback with the gains of the plan" if record.feedback else "as planned"
    counted = {"measured": "the wall time of the solver", "cpu": "the processor time of the solver"}
    return facts(
        [
            ("Plans", plans + "s" * (record.iterations != 1)),
            ("Commands between ticks", between),
            ("Plant", f"steps of {show(record.plant_dt, 4)} s{', ' if record.plant else ''}{record.plant}"),
            ("Latency that counts", counted.get(record.latency_kind, f"{record.latency_kind} s")),
            ("Evaluated by", f"{record.evaluator}, threads {record.threads}"),
        ]
    )


def plans_chart(record: ClosedLoopRecord) -> Chart | None:
    """Chart what happened, with what some plans predicted; the quantities that move most."""
    shown = most_varied(record.actual)
    if not shown or not len(record.plan_time):
        return None
    panels = list[Panel]()
    for column in shown:
        name, drawn = record.value_names[column], list[Line]()
        for time, value in zip(record.plan_time, record.plan_value[:, :, column], strict=True):
            drawn.append(Line("", palette.VERMILION, time, value, 0.9, "plain"))
            drawn.append(Line("", palette.VERMILION, time[:1], value[:1], look="points"))
        drawn.append(Line(name, palette.INK, record.actual_time, record.actual[:, column], 1.8))
        panels.append(Panel(name, tuple(drawn), TIME))
    keys = Key("what happened", palette.INK), Key("plans, from where they began", palette.VERMILION)
    return Chart("plans", "Plans and what happened, over time", tuple(panels), 1, keys)


def commands_chart(record: ClosedLoopRecord) -> Chart | None:
    """Chart what acted on the plant over time."""
    panels = list[Panel]()
    for column in most_varied(record.command):
        name, values = record.command_names[column], record.command[:, column]
        panels.append(Panel(name, (Line(name, palette.BLUE, record.command_time, values, 1.2, "steps"),), TIME))
    return Chart("commands", "Commands over time", tuple(panels)) if panels else None


def latency_chart(record: ClosedLoopRecord) -> Chart | None:
    """Chart how long plans took: as a histogram, and over time, with the period of a tick."""
    if not len(record.latency):
        return None
    wall, work, period = 1e3 * record.latency, 1e3 * record.work, 1e3 / record.rate
    edges = bin_edges(np.concatenate([wall, work, [period]]))
    counted, taken = list[Line](), list[Line]()
    for numbers, colour, name in ((wall, palette.BLUE, "wall time"), (work, palette.ORANGE, "processor time")):
        counts, _ = np.histogram(numbers, edges)
        counted.append(Line(name, colour, edges, np.append(counts, 0.0), 1.3, "steps area"))
        taken.append(Line(name, colour, record.asked, numbers, look="points"))
    histogram = Panel(
        "Plans by the time they took", tuple(counted), "[ms]", 1.0, -1.0, least=(0.0,), end=(period, "a tick")
    )
    over_time = Panel("Time that each plan took [ms]", tuple(taken), TIME, -1.0, edges=(period,))
    keys = Key("wall time", palette.BLUE), Key("processor time", palette.ORANGE)
    return Chart("latencies", "How long plans took", (histogram, over_time), 2, keys)


def most_varied(values: Array) -> list[int]:
    """Return the indices of the columns of (rows, k) values that vary most, in their order."""
    if not values.size:
        return []
    spread = np.ptp(values, axis=0)
    return sorted(int(k) for k in np.argsort(-spread, kind="stable")[:MOST_PANELS])


def bin_edges(numbers: Array) -> Array:
    """Return the edges of bins that are equally wide on a logarithmic axis."""
    known = numbers[np.isfinite(numbers) & (numbers > 0)]
    low, high = (float(known.min()), float(known.max())) if known.size else (1.0, 1.0)
    return np.geomspace(low / 1.05, high * 1.05, BINS + 1)
