"""The page of a batch: all run folders below a folder, by problem and solver."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from symphys import files
from symphys.findings import writing
from symphys.findings.verdict import ACCEPTED
from symphys.report.figures import style
from symphys.report.figures.checks import MOST_CHECKS, MOST_DOTS, draw_checks, ratios
from symphys.report.figures.convergence import draw_convergence
from symphys.report.figures.style import Picture, write_figures
from symphys.report.making.stamps import BATCH_PAGE, FULL, Stamp, batch_digest
from symphys.report.pages import comparison
from symphys.report.pages.brief import BriefReader, with_trace
from symphys.report.pages.comparison import page_links
from symphys.report.pages.markup import Html, card, facts, figures, join, page, slug, table, tag
from symphys.report.pages.rows import run_card, study_card
from symphys.report.robots.strip import draw_strip
from symphys.report.scene.animation import NUMBERS, animation
from symphys.report.scene.motion import draw_motion
from symphys.results.discovery import Entry, Study, read_all, sample, studies
from symphys.results.drawable import OVERSIZED, drawable, oversized
from symphys.results.file_names import FIGURES, GUESS, SCENE, TRAJECTORY
from symphys.results.run import Run
from symphys.results.scene import Scene, read_scene
from symphys.results.text_files import ReportError
from symphys.results.trajectories import POSES, read_trajectory
from symphys.trajectory import Trajectory

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
    """The runs whose pages could not be made, and why; nothing without any."""
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
    """The problems one after the other; with links to each and headings where there are several."""
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
    """The title, with the settings that tell it from another study of the same problem."""
    return f"{study.title}, {study.settings}" if study.settings else study.title


def name_of(folder: Path) -> str:
    """The folder's own name, whatever path it was given by."""
    return folder.resolve().name or "this folder"


def anchors(found: Sequence[Study]) -> list[str]:
    """A file-name stem and anchor for each study, all different."""
    names: list[str] = []
    for study in found:
        name, count = slug(study.problem), 1
        while name in names:
            count += 1
            name = f"{slug(study.problem)}-{count}"
        names.append(name)
    return names


def build_study(study: Study, root: Path, numbers: int, anchor: str, curves: int, every: Html | None = None) -> Html:
    """Everything about one problem.

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
        converged = style.picture(f"{anchor}-convergence", "Objective and errors", draw_convergence(drawable(whole)))
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
    """Pictures of the motion of a run, and its animation; in its place why there is none, which ends no page."""
    try:
        motion, guess, scene = read_motion(run)
        played = animation(motion, scene, guess, numbers)
        with style.paper():
            drawn = style.picture(f"{anchor}-strip", "The motion at even times", draw_strip(motion, scene))
            drawn += style.picture(f"{anchor}-motion", "Path and poses over time", draw_motion(motion, scene, guess))
    except ReportError as error:
        return [], tag("p", f"There is no motion to draw: {error}.")
    except Exception as error:  # what one run has recorded must not take the page of all with it
        return [], tag("p", f"The motion could not be drawn: {type(error).__name__}: {error}.")
    return drawn, played


def read_motion(run: Run) -> tuple[Trajectory, Trajectory | None, Scene]:
    """Motion, guess and scene of a run; ReportError where there is no motion."""
    motion = read_trajectory(run.folder / TRAJECTORY)
    try:
        scene = read_scene(run.folder / SCENE)
    except ReportError:
        scene = Scene()
    try:
        guess = read_trajectory(run.folder / GUESS, POSES)
    except ReportError:
        guess = None
    return motion, guess, scene


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
