"""The page of one run, made from its folder alone."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from symphys import files
from symphys.findings import writing
from symphys.findings.writing import show
from symphys.records import dataclass
from symphys.report.charts.chart import Chart
from symphys.report.charts.motion import motion_charts
from symphys.report.charts.run import run_charts
from symphys.report.making.stamps import BATCH_PAGE, RUN_PAGE, batch_page, folder_digest
from symphys.report.pages import sections
from symphys.report.pages.markup import Html, card, join, page, tag, write_viewer
from symphys.report.pages.motion import motion_card, motion_cards
from symphys.report.scene.animation import Film
from symphys.results import text_files as tables
from symphys.results.discovery import is_run_folder
from symphys.results.drawable import OVERSIZED, drawable, oversized
from symphys.results.file_names import CONFIG, FILM, GUESS, LOG, PROBLEM, SCENE, TRAJECTORY
from symphys.results.film import read_film
from symphys.results.run import Run, read_run
from symphys.results.scene import Scene, read_scene
from symphys.results.text_files import ReportError
from symphys.results.trajectories import POSES, read_trajectory
from symphys.trajectory import Trajectory

PAGE = RUN_PAGE
SWEPT_MOTIONS, SWEPT_FRAMES = 6, 30
"""Size of a film on the page of a run of a sweep, at most."""


@dataclass(frozen=True)
class RecordedMotion:
    """The motion of a run, as far as it could be read; ``faults`` names what could not."""

    trajectory: Trajectory | None
    guess: Trajectory | None
    scene: Scene
    faults: tuple[str, ...]


def write_run_report(run_dir: Path) -> Path:
    """Write report.html into a run folder, from its files alone; its script draws curves and plays the motion.

    The page says what it was made from, so that it need not be made again while that is the same.

    Args:
        run_dir: a run folder, finished or not; what is missing is said in the page.

    Returns:
        The page's path.

    Raises:
        ReportError: there is no such folder, it is no run folder, or it cannot be written to.
    """
    digest = folder_digest(run_dir)  # before files are read: what changes meanwhile is seen next time
    files.write_text(run_dir / PAGE, run_page(run_dir, digest, shared_viewer(run_dir)))
    return run_dir / PAGE


def write_single_page(run_dir: Path, out: Path) -> Path:
    """Write the page of a run as one file that needs no other, without links to other pages; errors as above."""
    files.write_text(out, run_page(run_dir, alone=True))
    return out


def run_page(run_dir: Path, digest: str = "", viewer: str = "", alone: bool = False) -> str:
    """Return the page of a run; ``alone``: without links to other pages."""
    run, recording = read_recorded(run_dir)
    charts = {chart.name: chart for chart in every_chart(run, recording)}
    body = join([build(run, recording, charts, alone), sections.FOOTER])
    return page(f"{run.title}: {run.solver}, seed {run.seed}", body, digest, viewer)


def shared_viewer(run_dir: Path) -> str:
    """Return the address of the script that draws motions, beside the page of all runs; empty where there is none."""
    above = batch_page(run_dir)
    if not above:
        return ""
    up = above.removesuffix(BATCH_PAGE)
    return up + write_viewer(run_dir / up)


def every_chart(run: Run, recording: RecordedMotion) -> list[Chart]:
    """Return every chart of a run's page; what there is nothing to show of is left out."""
    charts = run_charts(drawable(run), recording.trajectory)
    return charts if recording.trajectory is None else charts + motion_charts(recording.trajectory, recording.scene)


def write_run_figures(run_dir: Path, folder: Path) -> list[Path]:
    """Write every figure of a run's page into a folder: NAME.svg, and NAME.csv with the numbers that it shows.

    Returns:
        The paths.

    Raises:
        ReportError: there is no such run folder.
        FileError: ``folder`` cannot be written to.
    """
    from symphys.report.figures.run import draw_figures  # late: it imports matplotlib
    from symphys.report.figures.style import write_figures

    run, recording = read_recorded(run_dir)
    charts = every_chart(run, recording)
    return write_figures(folder, draw_figures(charts, recording.trajectory, recording.scene, recording.guess))


def read_recorded(run_dir: Path) -> tuple[Run, RecordedMotion]:
    """Read a run folder; ReportError if it is none."""
    if not run_dir.is_dir():
        raise ReportError(f"{run_dir}: there is no such folder")
    if not is_run_folder(run_dir):
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


def build(run: Run, recording: RecordedMotion, charts: Mapping[str, Chart], alone: bool = False) -> Html:
    """Make the page, from the verdict to the sources; ``alone``: without links to other pages."""
    motion, scene = recording.trajectory, recording.scene
    film = None if motion is None else film_of(run, motion)
    played = motion_card(motion, scene, recording.guess, recording.faults, film)
    cards = [
        sections.found(run, charts),
        sections.checks(run),
        played if motion is not None or run.readable else Html(""),
        sections.trusted(run, charts),
        sections.stage_card(run),
        sections.convergence(run, charts),
        *([] if motion is None else motion_cards(motion, scene, charts)),
        sections.time_split(run),
        sources(run),
    ]
    note = [tag("p", OVERSIZED, class_="note")] if oversized(run) else []
    return join([sections.header(run, cards, alone), *note, sections.key_numbers(run), *cards])


def film_of(run: Run, motion: Trajectory) -> Film | None:
    """Return the motions along the solve, with what each is worth; None where there are none, or of other bodies."""
    found, trace = read_film(run.folder / FILM), run.trace
    if found is None or found.position.shape[2] != len(motion.body_names) or found.rows.max() >= trace.rows:
        return None
    if run.settings:  # one of many: its page is to stay small
        found = found.thinned(SWEPT_MOTIONS, SWEPT_FRAMES)
    labels = [f"iteration {row}: objective {show(trace['objective'][row], 3)}" for row in found.rows[:-1].tolist()]
    last = f"the result: objective {show(run.objective, 3)}"
    return Film(found, (*labels, last), trace["equivalents"][found.rows])


def sources(run: Run) -> Html:
    """Show versions, command, and the files that the run was made from."""
    texts = [("Resolved configuration", CONFIG), ("Problem file", PROBLEM), ("Log of the solver", LOG)]
    folds = [sections.source(title, read_text(run.folder / name)) for title, name in texts]
    faults = [tag("p", f"Not read: {'; '.join(run.faults)}.", class_="note")] if run.faults else []
    return card("Provenance", sections.provenance(run), *faults, *folds, anchor="provenance")


def read_text(path: Path) -> str:
    """Read a file's text, JSON set out in lines; empty if it cannot be read."""
    try:
        text = tables.read_words(path)
        return json.dumps(json.loads(text), indent=2, ensure_ascii=False) if path.suffix == ".json" else text
    except (ReportError, RecursionError):
        return ""
    except ValueError:
        return writing.several(len(text), "character") + " that are no JSON:\n" + text
