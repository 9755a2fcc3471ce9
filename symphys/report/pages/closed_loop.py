"""The page of a closed loop: what `symphys mpc` writes."""

from __future__ import annotations

from pathlib import Path

from symphys import files
from symphys.findings.writing import percent, show
from symphys.report.figures import style
from symphys.report.figures.closed_loop import draw_commands, draw_latencies, draw_plans
from symphys.report.pages import motion, sections
from symphys.report.pages.joints import gait_card, joint_card
from symphys.report.pages.markup import Html, banner, card, facts, figures, join, page, pill, stats, table, tag
from symphys.results.closed_loop import ClosedLoopRecord, read_closed_loop
from symphys.results.file_names import FIGURES, SCENE, TRAJECTORY
from symphys.results.scene import read_scene
from symphys.results.trajectories import read_trajectory

ENOUGH = 0.99
"""Share of ticks in time that counts as keeping up."""
LATE = (
    "A plan acts from the moment it is ready. Until then the plan before goes on. While the solver works, ticks are "
    "missed: they count as not in time."
)


def write_closed_loop_page(folder: Path) -> Path:
    """Write the page of a closed loop from the files of its folder, and its figures as SVG and CSV beside it.

    Raises:
        ReportError: a file cannot be read or written.
    """
    record = read_closed_loop(folder)
    trajectory, scene = read_trajectory(folder / TRAJECTORY), read_scene(folder / SCENE)
    with style.paper():
        pictures = motion.draw(trajectory, scene)
        made = style.picture("plans", "Plans and what happened, over time", draw_plans(record))
        made += style.picture("commands", "Commands over time", draw_commands(record))
        made += style.picture("latencies", "How long plans took", draw_latencies(record))
    pictures |= {picture.name: picture for picture in made}
    style.write_figures(folder / FIGURES, pictures.values())

    def drawn(name: str) -> Html:
        return figures([pictures[name]]) if name in pictures else Html("")

    body = join(
        [
            tag("p", f"Closed loop · {record.problem}", class_="kicker"),
            tag("h1", record.title),
            verdict(record),
            numbers(record),
            card("Targets", targets(record), anchor="checks", note="Of the plant, at the end of the closed loop."),
            sections.motion(trajectory, scene, None, pictures, ()),
            card("Plans and what happened", drawn("plans"), anchor="plans"),
            card("Commands", drawn("commands"), anchor="commands"),
            card("Latency", drawn("latencies"), anchor="latency", note=LATE),
            joint_card(trajectory, scene, pictures),
            gait_card(trajectory, scene, pictures),
            card("Setting", setting(record), anchor="provenance"),
        ]
    )
    out = folder / "report.html"
    files.write_text(out, page(record.title, body, animated=True))
    return out


def verdict(record: ClosedLoopRecord) -> Html:
    """Whether the task is done, and whether plans came in time."""
    if record.stopped:
        title, level = f"Stopped after {show(record.duration, 3)} s: {record.stopped}", "bad"
    elif not record.targets:
        title, level = f"Ran for {show(record.duration, 3)} s", "good"
    elif record.done:
        title, level = f"All targets are met at the end, and have been for {show(record.held, 3)} s", "good"
    else:
        missed = ", ".join(target.name for target in record.targets if not target.met)
        title, level = f"Not met at the end: {missed}", "bad"
    if level == "good" and record.share < ENOUGH:
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
    """How it was made."""
    plans = f"{show(record.horizon, 4)} s ahead in steps of {show(record.dt, 4)} s, {record.iterations} iteration"
    between = "answer what is measured, by the gains of the plan" if record.feedback else "as planned"
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
