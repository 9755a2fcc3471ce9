"""The page of one run, made from its folder alone."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from symphys import files
from symphys.findings import writing
from symphys.report.charts.drawing import chart_pictures
from symphys.report.charts.motion import motion_charts
from symphys.report.charts.run import run_charts
from symphys.report.figures.style import Picture, paper, write_figures
from symphys.report.making.stamps import FULL, LIGHT, RUN_PAGE, Stamp, folder_digest
from symphys.report.pages import sections
from symphys.report.pages.markup import Drawn, Html, card, join, light_page, page, tag
from symphys.report.pages.motion import motion_card, motion_cards, motion_pictures
from symphys.results import text_files as tables
from symphys.results.discovery import is_run
from symphys.results.drawable import OVERSIZED, drawable, oversized
from symphys.results.file_names import CONFIG, FIGURES, GUESS, LOG, PROBLEM, SCENE, TRAJECTORY
from symphys.results.run import Run, read_run
from symphys.results.scene import Scene, read_scene
from symphys.results.text_files import ReportError
from symphys.results.trajectories import POSES, read_trajectory
from symphys.trajectory import Trajectory

PAGE = RUN_PAGE


@dataclass(frozen=True)
class RecordedMotion:
    """The motion of a run, as far as it could be read; ``faults`` names what could not."""

    trajectory: Trajectory | None
    guess: Trajectory | None
    scene: Scene
    faults: tuple[str, ...]


def write_run_report(run_dir: Path) -> Path:
    """Write report.html, and figures as SVG and CSV, into a run folder, from its files alone.

    The page says what it was made from, so that it need not be made again while that is the same.

    Args:
        run_dir: a run folder, finished or not; what is missing is said in the page.

    Returns:
        The page's path.

    Raises:
        ReportError: there is no such folder, it is no run folder, or it cannot be written to.
    """
    digest = folder_digest(run_dir)  # before files are read: what changes meanwhile is seen next time
    run, recording, pictures = drawn(run_dir)
    write_figures(run_dir / FIGURES, pictures.values())
    body, animated = join([build(run, recording, pictures), sections.FOOTER]), recording.trajectory is not None
    files.write_text(run_dir / PAGE, page(title_of(run), body, animated, stamp=Stamp(FULL, digest)))
    return run_dir / PAGE


def write_light_report(run_dir: Path) -> Path:
    """Write a light report.html: all but figures as files; its curves and its motion are drawn in the browser.

    It takes some 20 ms, and 50 kB on disk. Arguments, result and errors are those of ``write_run_report``.
    """
    digest = folder_digest(run_dir)
    run, recording = read_recorded(run_dir)
    charts: dict[str, Drawn] = {chart.name: chart for chart in run_charts(drawable(run), recording.trajectory)}
    if recording.trajectory is not None:
        charts |= {chart.name: chart for chart in motion_charts(recording.trajectory, recording.scene)}
    body, animated = join([build(run, recording, charts), sections.LIGHT]), recording.trajectory is not None
    files.write_text(run_dir / PAGE, light_page(title_of(run), body, animated, Stamp(LIGHT, digest)))
    return run_dir / PAGE


def title_of(run: Run) -> str:
    """Return the title of the page."""
    return f"{run.title}: {run.solver}, seed {run.seed}"


def write_run_figures(run_dir: Path, folder: Path) -> list[Path]:
    """Write every figure of a run's page into a folder: NAME.svg, and NAME.csv with the numbers that it shows.

    Returns:
        The paths.

    Raises:
        ReportError: there is no such run folder.
        FileError: ``folder`` cannot be written to.
    """
    return write_figures(folder, drawn(run_dir)[2].values())


def drawn(run_dir: Path) -> tuple[Run, RecordedMotion, dict[str, Picture]]:
    """Read a run folder and draw every figure of its page; what it does not have is left out."""
    run, recording = read_recorded(run_dir)
    motion = recording.trajectory
    with paper():
        pictures = {each.name: each for each in chart_pictures(run_charts(drawable(run), motion))}
        if motion is not None:
            pictures |= motion_pictures(motion, recording.scene, recording.guess)
    return run, recording, pictures


def read_recorded(run_dir: Path) -> tuple[Run, RecordedMotion]:
    """Read a run folder; ReportError if it is none."""
    if not run_dir.is_dir():
        raise ReportError(f"{run_dir}: there is no such folder")
    if not is_run([path.name for path in run_dir.iterdir()]):
        raise ReportError(f"{run_dir}: no run folder; one holds result.json, or config.json and problem.toml")
    return read_run(run_dir, run_dir), read_motions(run_dir)


def read_motions(folder: Path) -> RecordedMotion:
    """Read motion, guess and scene of a run folder, as far as they can be read."""
    faults: list[str] = []
    trajectory = read_or_note(folder / TRAJECTORY, faults)
    guess = read_or_note(folder / GUESS, faults, POSES)
    try:
        scene = read_scene(folder / SCENE)
    except ReportError as error:
        scene = Scene()
        faults.append(str(error))
    return RecordedMotion(trajectory, guess, scene, tuple(faults))


def read_or_note(path: Path, faults: list[str], only: Sequence[str] = ()) -> Trajectory | None:
    """Read a recorded motion, or ``only`` some arrays of it; None, with a sentence in ``faults``, if there is none."""
    try:
        return read_trajectory(path, only)
    except ReportError as error:
        faults.append(str(error))
        return None


def build(run: Run, recording: RecordedMotion, pictures: Mapping[str, Drawn]) -> Html:
    """Make the page, from the verdict to the sources."""
    motion, scene = recording.trajectory, recording.scene
    played = motion_card(motion, scene, recording.guess, pictures, recording.faults)
    cards = [
        sections.checks(run),
        played if motion is not None or run.readable else Html(""),
        sections.found(run, pictures),
        sections.trusted(run, pictures),
        sections.stage_card(run),
        sections.convergence(run, pictures),
        *([] if motion is None else motion_cards(motion, scene, pictures)),
        sections.time_split(run),
        sources(run),
    ]
    note = [tag("p", OVERSIZED, class_="note")] if oversized(run) else []
    return join([sections.header(run, cards), *note, sections.key_numbers(run), *cards])


def sources(run: Run) -> Html:
    """Show versions, command, and the files that the run was made from."""
    texts = [("Resolved configuration", CONFIG), ("Problem file", PROBLEM), ("Log of the solver", LOG)]
    folds = [sections.source(title, read_text(run.folder / name)) for title, name in texts]
    faults = [tag("p", f"Not read: {'; '.join(run.faults)}.", class_="note")] if run.faults else []
    return card("Where this comes from", sections.provenance(run), *faults, *folds, anchor="provenance")


def read_text(path: Path) -> str:
    """Read a file's text, JSON set out in lines; empty if it cannot be read."""
    try:
        text = tables.read_words(path)
        return json.dumps(json.loads(text), indent=2, ensure_ascii=False) if path.suffix == ".json" else text
    except (ReportError, RecursionError):
        return ""
    except ValueError:
        return writing.several(len(text), "character") + " that are no JSON:\n" + text
