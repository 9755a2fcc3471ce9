"""The page of a batch: all run folders below a folder, by problem and solver."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from symphys import files
from symphys.findings import writing
from symphys.findings.verdict import ACCEPTED
from symphys.report.charts.convergence import convergence_chart
from symphys.report.making.stamps import BATCH_PAGE, batch_digest
from symphys.report.pages import comparison, words
from symphys.report.pages.answers import answers_card
from symphys.report.pages.check_figure import MOST_CHECKS, MOST_DOTS, check_figure, ratios
from symphys.report.pages.comparison import page_links, run_card, study_card
from symphys.report.pages.markup import Html, card, facts, figures, join, page, slug, table, tag, write_viewer
from symphys.report.pages.run import film_of, read_motions
from symphys.report.pages.sweep import sweep_of, sweep_parts
from symphys.report.scene.animation import LEAST_FRAMES, NUMBERS, animation, other_motion
from symphys.results.config import settings_words
from symphys.results.discovery import Entry, Study, read_all, sample, studies
from symphys.results.drawable import OVERSIZED, drawable, oversized
from symphys.results.file_names import TRAJECTORY
from symphys.results.run import BriefReader, Run, with_trace
from symphys.results.text_files import ReportError

PAGE = BATCH_PAGE
UNMADE = "0" * 64
"""Stands for the digest of a batch of which some pages could not be made."""
CLOSEST = "run that came closest"
MOST_NUMBERS = 60_000
"""Numbers that the motions on a page have together, at most about."""
MOST_SIDE_BY_SIDE = 4
SIDE_BY_SIDE = "The best run of each solver. One moment is shown in all of them."
MOST_MOTIONS = 60
"""Motions of a sweep that a page can play, at most."""
MOST_STUDIES = 20
"""Problems and settings that have a section each, at most; of more the page has tables only."""
MOST_CURVES, LEAST_CURVES = 60, 5
"""Runs whose convergence a page draws at most about, and at least of each solver."""


def write_batch_report(batch_dir: Path, unmade: Mapping[Path, str] | None = None) -> Path:
    """Write index.html for all run folders found at or below a folder.

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
    one = len({study.problem for study in found}) == 1
    title = found[0].title if one else f"{writing.several(len(found), 'problem')} in “{name_of(batch_dir)}”"
    parts = [
        tag("p", "Batch report", class_="kicker"),
        tag("h1", title),
        tag("p", comparison.summary(found, broken), class_="lead"),
        *build_sections(found),
        comparison.broken_card(broken),
        unmade_card(batch_dir, unmade or {}),
        provenance(runs),
        tag("footer", "Made by symphys from the run folders alone; make it again with “symphys report”."),
    ]
    files.write_text(batch_dir / PAGE, page(title, join(parts), digest, write_viewer(batch_dir)))
    return batch_dir / PAGE


def build_sections(found: Sequence[Study]) -> list[Html]:
    """Return a sweep as a whole, few problems one after the other, and many as tables."""
    sweep = sweep_of(found)
    if sweep is None:
        return build_tables(found) if len(found) > MOST_STUDIES else build_studies(found)
    links = page_links(sweep.every)
    best = Study(found[0].problem, "", tuple(entry for study in found for entry in study.entries)).best
    others = other_motions(sweep.runs, links)
    note = best_note(best, setting=True) + " Under the pointer on a number above: that of its run." * bool(others)
    motion = card("The motion", best_motion(best, NUMBERS, others), note=note)
    return [*sweep_parts(sweep, links), motion, run_card(found, links)]


def best_note(best: Run, setting: bool = False) -> str:
    """Say which run a motion is of; ``setting``: with its settings."""
    kind = "best run" if best.verdict in ACCEPTED else "run with the lowest objective" if best.met else CLOSEST
    where = f" with {settings_words(best.settings)}" * (setting and bool(best.settings))
    return f"The {kind}: {best.solver}, seed {best.seed}{where}."


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


def build_studies(found: Sequence[Study]) -> list[Html]:
    """Return the problems one after the other; with links to each and headings where there are several."""
    if not found:
        return []
    names = anchors(found)
    links = [tag("a", linked(study), href=f"#{anchor}") for study, anchor in zip(found, names, strict=True)]
    curves = curve_count(found)
    runs = [run for study in found for run in study.runs]
    every = run_card(found, page_links(runs)) if len(runs) > 1 else Html("")
    if len(found) == 1:
        return [build_study(found[0], NUMBERS, names[0], curves, every)]
    room = min(NUMBERS, MOST_NUMBERS // len(found))
    parts = [build_study(study, room, name, curves) for study, name in zip(found, names, strict=True)]
    return [tag("nav", *links, aria_label="Problems"), *parts, every]


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


def build_study(study: Study, numbers: int, anchor: str, curves: int, every: Html | None = None) -> Html:
    """Make the section of one problem.

    Args:
        study: the problem's runs, read for tables.
        numbers: that its motion takes at most.
        anchor: of its section.
        curves: runs of a solver whose convergence is drawn, at most.
        every: the table of all runs; None where the page has several problems.
    """
    titled, whole = every is None, with_traces(study, curves)
    converged = convergence_chart(f"{anchor}-convergence", drawable(whole))
    place = f" in {study.place}" if study.place and study.place != study.problem else ""
    return tag(
        "section",
        tag("h2", study.title) if titled else "",
        tag("p", f"{study.problem}{place}", class_="kicker") if titled else "",
        tag("p", f"With {study.settings}.", class_="note") if study.settings else "",
        comparison.study_verdict(study),
        tag("p", OVERSIZED, class_="note") if oversized(whole) or oversized([r.objective for r in study.runs]) else "",
        answers_card(study),
        card("Solvers", comparison.solver_table(study), note=comparison.table_note(study)),
        card("Convergence", figures([converged] if converged else [], comparison.convergence_note(study, curves))),
        motions(study, numbers),
        targets(study),
        every or "",
        class_="study" if titled else None,
        id=anchor,
    )


def with_traces(study: Study, curves: int) -> Study:
    """Return at most ``curves`` runs of each solver, with their traces."""
    few = sample(study, curves)
    return Study(few.problem, few.place, tuple(Entry(e.solver, tuple(map(with_trace, e.runs))) for e in few.entries))


def curve_count(found: Sequence[Study]) -> int:
    """Return how many runs of a solver have their convergence drawn, at most."""
    return max(MOST_CURVES // sum(len(study.entries) for study in found), LEAST_CURVES)


def write_batch_figures(batch_dir: Path, folder: Path) -> list[Path]:
    """Write the convergence of each problem of a batch and the motion of its best run as NAME.svg and NAME.csv.

    None of more than ``MOST_STUDIES`` problems. Arguments and errors are those of ``write_run_figures``.
    """
    from symphys.report.figures.run import draw_figures  # late: it imports matplotlib
    from symphys.report.figures.style import write_figures

    found, paths = studies(read_all(batch_dir, BriefReader(batch_dir))[0]), list[Path]()
    for study, anchor in zip(found, anchors(found), strict=True) if len(found) <= MOST_STUDIES else ():
        chart = convergence_chart("convergence", drawable(with_traces(study, curve_count(found))))
        best = read_motions(study.best.folder)
        pictures = draw_figures([chart] if chart else [], best.trajectory, best.scene, best.guess)
        paths += write_figures(folder, [replace(each, name=f"{anchor}-{each.name}") for each in pictures])
    return paths


def motions(study: Study, numbers: int) -> Html:
    """Play the motion of the best run of each solver side by side, or of the best of all where there are many."""
    best = [Study(study.problem, study.place, (entry,)).best for entry in study.entries]
    moving = [run for run in best if (run.folder / TRAJECTORY).is_file()]
    if not 1 < len(moving) <= MOST_SIDE_BY_SIDE:
        return card("The motion", best_motion(study.best, numbers), note=best_note(study.best))
    parts = []
    for run in moving:
        title = f"{run.solver}, seed {run.seed}" if len(study.runs) > len(moving) else run.solver
        parts.append(tag("div", tag("h3", title), best_motion(run, numbers // len(moving))))
    return card("The motions", tag("div", *parts, class_="side-by-side"), note=SIDE_BY_SIDE)


def other_motions(runs: Sequence[Run], links: Mapping[str, str]) -> list[Html]:
    """Return the motions of runs that have a page; of an even choice of them where they are many or large."""
    linked = [run for run in runs if links.get(run.place)]
    found, count = list[Html](), min(len(linked), MOST_MOTIONS)
    for k in range(len(linked)):
        if len(found) * len(linked) > k * count:
            continue
        run = linked[k]
        recording = read_motions(run.folder)
        if recording.trajectory is None:
            continue
        bodies = len(recording.trajectory.body_names)
        count = min(count, max(MOST_NUMBERS // (LEAST_FRAMES * 7 * bodies), 1))
        numbers = min(MOST_NUMBERS // count, NUMBERS)
        title = words.setting_title(run)
        found.append(other_motion(recording.trajectory, recording.scene, numbers, links[run.place], title))
    return found


def best_motion(run: Run, numbers: int, others: Sequence[Html] = ()) -> Html:
    """Play the motion of a run; or say why there is none, which ends no page."""
    try:
        recording = read_motions(run.folder)
        if recording.trajectory is None:
            return tag("p", f"There is no motion to draw: {recording.faults[0]}.")
        film = None if run.settings else film_of(with_trace(run), recording.trajectory)
        return animation(recording.trajectory, recording.scene, recording.guess, numbers, others, film)
    except Exception as error:  # what one run has recorded must not take the page of all with it
        return tag("p", f"The motion could not be drawn: {type(error).__name__}: {error}.")


def targets(study: Study) -> Html:
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
    parts = [check_figure(study), tag("p", caption, class_="caption"), content] if rows else []
    return card("Targets and constraints", *parts)


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
    return card("Provenance", content)
