"""The page of a batch: all run folders below a folder, by problem and solver."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from symphys import files
from symphys.findings import writing
from symphys.findings.verdict import ACCEPTED
from symphys.report.charts.convergence import convergence_chart
from symphys.report.charts.drawing import chart_pictures
from symphys.report.figures import style
from symphys.report.figures.data import Column, DataFigure, keep
from symphys.report.figures.style import Picture, write_figures
from symphys.report.making.stamps import BATCH_PAGE, FULL, Stamp, batch_digest
from symphys.report.pages import comparison
from symphys.report.pages.comparison import page_links, run_card, study_card
from symphys.report.pages.markup import Html, card, facts, figures, join, page, slug, table, tag
from symphys.report.pages.run import read_motions
from symphys.report.robots.strip import draw_strip
from symphys.report.scene.animation import NUMBERS, animation
from symphys.report.scene.motion import draw_motion
from symphys.results.discovery import Entry, Study, read_all, sample, studies
from symphys.results.drawable import OVERSIZED, drawable, oversized
from symphys.results.file_names import FIGURES
from symphys.results.run import BriefReader, Run, with_trace
from symphys.results.text_files import ReportError
from symphys.types import Array

PAGE = BATCH_PAGE
UNMADE = "0" * 64
"""Stands for the digest of a batch of which some pages could not be made."""
CLOSEST = "run that came closest"
ROWS_MARK = 'class="rows"'
MOST_STUDIES = 20
"""Problems and settings that have a section each, at most; of more the page has tables only."""
MOST_CURVES, LEAST_CURVES = 60, 5
"""Runs whose convergence a page draws at most about, and at least of each solver."""


def write_batch_report(batch_dir: Path, unmade: Mapping[Path, str] | None = None) -> Path:
    """Write index.html, and figures as SVG and CSV, for all run folders found at or below a folder.

    Args:
        batch_dir: what ``symphys solve --out`` has written, or any folder above it. Links go to the pages of the
            runs as far as they exist, so write those first.
        unmade: the runs whose pages could not be made, and why, which the page says.

    Returns:
        The page's path.

    Raises:
        ReportError: there is no such folder, it holds no run folder, or it cannot be written to.
    """
    # Before files are read: what changes meanwhile is seen next time. A page that names faults is never up to date.
    digest = UNMADE if unmade else batch_digest(batch_dir)
    runs, broken = read_all(batch_dir, BriefReader(batch_dir))
    if not runs and not broken:
        raise ReportError(f"{batch_dir}: no run folder at or below it; `symphys solve --out` writes them")
    found = studies(runs)
    title = found[0].title if len(found) == 1 else f"{writing.several(len(found), 'problem')} in “{name_of(batch_dir)}”"
    parts = [
        tag("p", "Batch report", class_="kicker"),
        tag("h1", title),
        tag("p", comparison.summary(found, broken), class_="lead"),
        *(build_tables(found) if len(found) > MOST_STUDIES else build_studies(found, batch_dir)),
        comparison.broken_card(broken),
        unmade_card(batch_dir, unmade or {}),
        provenance(runs),
        tag("footer", "Made by symphys from the run folders alone; make it again with “symphys report”."),
    ]
    animated, rows = (any(mark in part for part in parts) for mark in ("<canvas", ROWS_MARK))
    files.write_text(batch_dir / PAGE, page(title, join(parts), animated, rows, Stamp(FULL, digest)))
    return batch_dir / PAGE


def unmade_card(root: Path, unmade: Mapping[Path, str]) -> Html:
    """Return the runs whose pages could not be made, and why; nothing without any."""
    named = list(unmade.items())[: comparison.MOST_BROKEN]
    rows = [[tag("code", folder.relative_to(root).as_posix()), why] for folder, why in named]
    more = f" The first {len(named)} of {len(unmade)}." if len(named) < len(unmade) else ""
    note = f"These runs have no page, or an older one.{more}"
    return card("Pages that could not be made", table(["run", "why"], rows, "tt", "Pages") if rows else "", note=note)


def build_tables(found: Sequence[Study]) -> list[Html]:
    """Many problems, or one under many settings, and all their runs: as tables."""
    links = page_links([run for study in found for run in study.runs])
    return [study_card(found, links, MOST_STUDIES), run_card(found, links)]


def build_studies(found: Sequence[Study], root: Path) -> list[Html]:
    """Return the problems one after the other; with links to each and headings where there are several."""
    if not found:
        return []
    names = anchors(found)
    links = [tag("a", linked(study), href=f"#{anchor}") for study, anchor in zip(found, names, strict=True)]
    curves = max(MOST_CURVES // sum(len(study.entries) for study in found), LEAST_CURVES)
    runs = [run for study in found for run in study.runs]
    long = any(len(entry.runs) > comparison.MOST_CHIPS for study in found for entry in study.entries)
    every = run_card(found, page_links(runs)) if long else Html("")
    if len(found) == 1:
        return [build_study(found[0], root, NUMBERS, names[0], curves, every)]
    room = NUMBERS // max(len(found), 1)
    parts = [build_study(study, root, room, name, curves) for study, name in zip(found, names, strict=True)]
    return [tag("nav", *links, aria_label="Problems"), every, *parts]


def linked(study: Study) -> str:
    """Return the title, with the settings that tell it from another study of the same problem."""
    return f"{study.title}, {study.settings}" if study.settings else study.title


def name_of(folder: Path) -> str:
    """Return the folder's own name, whatever path it was given by."""
    return folder.resolve().name or "this folder"


def anchors(found: Sequence[Study]) -> list[str]:
    """Return a file-name stem and anchor for each study, all different."""
    names: list[str] = []
    for study in found:
        name, count = slug(study.problem), 1
        while name in names:
            count += 1
            name = f"{slug(study.problem)}-{count}"
        names.append(name)
    return names


def build_study(study: Study, root: Path, numbers: int, anchor: str, curves: int, every: Html | None = None) -> Html:
    """Make the section of one problem.

    Args:
        study: the problem's runs, read for tables.
        root: the folder of the batch.
        numbers: that its motion takes at most.
        anchor: of its section, and before the names of its figures.
        curves: runs of a solver whose convergence is drawn, at most.
        every: the table of all runs; None where the page has several problems.
    """
    titled, few = every is None, sample(study, curves)
    whole = Study(few.problem, few.place, tuple(Entry(e.solver, tuple(map(with_trace, e.runs))) for e in few.entries))
    moved, played = best_motion(study.best, anchor, numbers)
    with style.paper():
        converged = chart_pictures([convergence_chart(f"{anchor}-convergence", drawable(whole))])
        checked = style.picture(f"{anchor}-checks", "Errors against tolerances", draw_checks(study))
    write_figures(root / FIGURES, converged + checked + moved)
    best = study.best
    kind = "best run" if best.verdict in ACCEPTED else "run with the lowest objective" if best.met else CLOSEST
    which = f"The {kind}: {best.solver}, seed {best.seed}."
    place = f" in {study.place}" if study.place and study.place != study.problem else ""
    return tag(
        "section",
        tag("h2", study.title) if titled else "",
        tag("p", f"{study.problem}{place}", class_="kicker") if titled else "",
        tag("p", f"With {study.settings}.", class_="note") if study.settings else "",
        comparison.study_verdict(study),
        tag("p", OVERSIZED, class_="note") if oversized(whole) or oversized([r.objective for r in study.runs]) else "",
        card("Solvers", comparison.solver_table(study), note=comparison.table_note(study)),
        every or "",
        card("Convergence", figures(converged, comparison.convergence_note(study, curves))),
        card("The motion", played, figures(moved), note=which),
        targets(study, checked),
        class_="study" if titled else None,
        id=anchor,
    )


def best_motion(run: Run, anchor: str, numbers: int) -> tuple[list[Picture], Html]:
    """Draw the motion of a run, and play it; or say why there is none, which ends no page."""
    try:
        recording = read_motions(run.folder)
        motion, scene, guess = recording.trajectory, recording.scene, recording.guess
        if motion is None:
            return [], tag("p", f"There is no motion to draw: {recording.faults[0]}.")
        played = animation(motion, scene, guess, numbers)
        with style.paper():
            drawn = style.picture(f"{anchor}-strip", "The motion at even times", draw_strip(motion, scene))
            drawn += style.picture(f"{anchor}-motion", "Path and poses over time", draw_motion(motion, scene, guess))
    except Exception as error:  # what one run has recorded must not take the page of all with it
        return [], tag("p", f"The motion could not be drawn: {type(error).__name__}: {error}.")
    return drawn, played


def targets(study: Study, pictures: list[Picture]) -> Html:
    """Targets met or missed by name, for every solver."""
    found = ratios(study)
    hidden = len(found) - MOST_CHECKS
    caption = "Dots: single seeds; marks: their median, hollow where it misses; arrows go on beyond the axis."
    if hidden > 0:
        caption += f" Shown: the {MOST_CHECKS} of {len(found)} checks with the largest errors."
    if any(len(entry.runs) > MOST_DOTS for entry in study.entries):
        caption += f" Of more than {MOST_DOTS} seeds so many are dots; medians and ranges are of all."
    solvers = [entry.solver for entry in study.entries]
    checks = comparison.checks_by_solver(study)
    rows = [[name, *(comparison.check_cell(checks.get((name, solver), [])) for solver in solvers)] for name in found]
    content = table(["error, median over seeds", *solvers], rows, "t" + "n" * len(solvers), "Errors by name")
    return card("Targets and constraints", figures(pictures, caption), content if rows else "")


def provenance(runs: Sequence[Run]) -> Html:
    """Versions, machines, times and commands of all runs, each once."""

    def once(texts: Sequence[str], most: int = 6) -> str:
        known = list(dict.fromkeys(text for text in texts if text))
        return "; ".join(known[:most]) + (f"; and {len(known) - most} more" if len(known) > most else "")

    when = sorted(run.when for run in runs if run.when)
    span = when[0] if len(set(when)) == 1 else f"{when[0]} to {when[-1]}" if when else ""
    named = ("symphys", "python", "casadi", "numpy", "scipy", "cma")
    versions = [", ".join(f"{n} {run.versions[n]}" for n in named if run.versions.get(n)) for run in runs]
    commands = once([run.command for run in runs])
    content = facts(
        [
            ("Command", tag("code", commands) if commands else ""),
            ("When", span),
            ("Machine", once([run.versions.get("platform", "") for run in runs])),
            ("Versions", once(versions)),
            ("Evaluated by", once([str(run.backend) for run in runs])),
        ]
    )
    return card("Where this comes from", content)


MOST_CHECKS = 16
MOST_DOTS = 200
"""Seeds of a solver that are drawn as dots, at most."""
LOWEST, HIGHEST = 1e-3, 1e4
"""Ratios are drawn between these at most; beyond them stands an arrow."""

Ratios = dict[str, dict[str, Array]]


def ratios(study: Study) -> Ratios:
    """Error / tolerance by check and solver, one per seed; nan counts as inf."""
    found: dict[str, dict[str, list[float]]] = {}
    for run in study.runs:
        for check in run.checks:
            ratio = np.inf if np.isnan(check.ratio) else check.ratio
            found.setdefault(check.name, {}).setdefault(run.solver, []).append(ratio)
    return {name: {key: np.array(seeds) for key, seeds in solvers.items()} for name, solvers in found.items()}


def shown_checks(found: Ratios) -> list[str]:
    """Return the checks that get a row: all, or those with the largest medians, in the file's order."""
    worst = {name: max(float(np.median(seeds)) for seeds in solvers.values()) for name, solvers in found.items()}
    kept = set(sorted(worst, key=lambda name: -worst[name])[:MOST_CHECKS])
    return [name for name in found if name in kept]


def draw_checks(study: Study) -> DataFigure | None:
    """Draw a row for each check, a lane for each solver: dots for seeds, a mark for their median, a line at 1."""
    found = ratios(study)
    if not found:
        return None
    names = shown_checks(found)
    marks = style.solver_marks(entry.solver for entry in study.entries)
    lane = 0.15
    row = max(lane * len(marks) + 0.16, 0.36)
    figure = DataFigure(figsize=(style.WIDTH, 1.15 + row * len(names)), layout="constrained")
    axes = figure.subplots()
    low, high = limits(found)
    dress(axes, names, low, high)
    for place, name in enumerate(names):
        for order, solver in enumerate(marks):
            if solver in found[name]:
                height = place + (order - (len(marks) - 1) / 2) * lane / row
                draw_lane(axes, height, np.clip(found[name][solver], low, high), marks[solver], (low, high))
    keep_ratios(axes, sample(study, MOST_DOTS), names)
    handles = [Line2D([], [], color=c, marker=m, linestyle="none", markersize=6) for c, m in marks.values()]
    style.legend_above(figure, handles, [style.short(name, 20) for name in marks])
    return figure


def keep_ratios(axes: Axes, study: Study, names: list[str]) -> None:
    """Keep the errors of every run in these checks."""
    rows = [(name, run, check) for name in names for run in study.runs for check in run.checks if check.name == name]
    columns: dict[str, Column] = {
        "check": [name for name, _, _ in rows],
        "solver": [run.solver for _, run, _ in rows],
        "seed": [run.seed for _, run, _ in rows],
        "error": [check.error for _, _, check in rows],
        "tolerance": [check.tolerance for _, _, check in rows],
        "error / tolerance": [check.ratio for _, _, check in rows],
    }
    keep(axes, columns)


def limits(found: Ratios) -> tuple[float, float]:
    """Return the range of the axis: whole decades around the ratios and 1."""
    every = np.concatenate([seeds for solvers in found.values() for seeds in solvers.values()])
    positive = every[np.isfinite(every) & (every > 0)]
    low = 10 ** np.floor(np.log10(min(positive.min(initial=1.0), 0.3)))
    high = 10 ** np.ceil(np.log10(max(positive.max(initial=1.0), 3.0)))
    return float(np.clip(low, LOWEST, 0.1)), float(np.clip(high, 10.0, HIGHEST))


def dress(axes: Axes, names: list[str], low: float, high: float) -> None:
    """Name the rows, and draw the logarithmic axis and the tolerance at 1."""
    axes.set_yticks(range(len(names)), [style.short(name, 46) for name in names])
    axes.tick_params(axis="y", labelcolor=style.INK, labelsize=8.5)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    for border in range(1, len(names)):
        axes.axhline(border - 0.5, color=style.GRID, linewidth=0.7)
    style.set_log(axes, "x", np.array([low, high]))
    axes.set_xlim(low / 1.3, high * 1.3)
    axes.axvspan(low / 1.3, 1, color=style.MET, linewidth=0, zorder=0.5)
    axes.axvline(1, color=style.GREEN, linewidth=1, linestyle=(0, (4, 2)), zorder=1)
    axes.set_xlabel("error / tolerance (met at 1 or below)")


def draw_lane(axes: Axes, height: float, seeds: Array, mark: tuple[str, str], ends: tuple[float, float]) -> None:
    """Draw the seeds of one solver in one check."""
    colour, marker = mark
    middle = float(np.median(seeds))
    if seeds.size > 1:
        axes.plot([seeds.min(), seeds.max()], [height, height], color=colour, linewidth=0.8, alpha=0.4, zorder=2)
        dots = seeds[np.linspace(0, seeds.size - 1, min(seeds.size, MOST_DOTS)).round().astype(int)]
        axes.plot(dots, np.full(dots.size, height), "o", color=colour, markersize=3, alpha=0.35, zorder=2.5)
    face = colour if middle <= 1 else "white"
    beyond = {ends[0]: "<", ends[1]: ">"}
    axes.plot(middle, height, beyond.get(middle, marker), color=colour, markerfacecolor=face, markersize=6, zorder=3)
