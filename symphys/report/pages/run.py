"""The page of one run, made from its folder alone."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from symphys import files
from symphys.findings import writing
from symphys.report.charts.motion import motion_charts
from symphys.report.charts.run import run_charts
from symphys.report.figures import style
from symphys.report.figures.contacts import by_surfaces, draw_contacts, shown_pairs
from symphys.report.figures.history import draw_run
from symphys.report.figures.states import MOST_BODIES, controlled_bodies, draw_controls, draw_states, shown_bodies
from symphys.report.figures.style import Picture, write_figures
from symphys.report.figures.variables import draw_variables
from symphys.report.figures.verification import draw_energy, draw_growth
from symphys.report.making.stamps import FULL, LIGHT, RUN_PAGE, Stamp, folder_digest
from symphys.report.pages import sections
from symphys.report.pages.joints import gait_card, joint_card, joint_pictures
from symphys.report.pages.markup import Drawn, Html, card, figures, join, light_page, page, tag
from symphys.report.pages.stages import stage_card
from symphys.report.pages.verification import trusted
from symphys.report.scene.motion import draw_motion
from symphys.results import text_files as tables
from symphys.results.discovery import is_run
from symphys.results.drawable import OVERSIZED, drawable, oversized
from symphys.results.file_names import CONFIG, FIGURES, GUESS, PROBLEM, SCENE, TRAJECTORY
from symphys.results.result import smoothed
from symphys.results.run import Run, read_run
from symphys.results.scene import Scene, read_scene
from symphys.results.text_files import ReportError
from symphys.results.trajectories import POSES, read_trajectory
from symphys.trajectory import Trajectory

PAGE = RUN_PAGE
LOG = "log.txt"


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
    """Of the page."""
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
    """A run folder as it was read, and every figure of its page by name."""
    run, recording = read_recorded(run_dir)
    with style.paper():
        return run, recording, draw(drawable(run), recording)


def read_recorded(run_dir: Path) -> tuple[Run, RecordedMotion]:
    """A run folder as it was read; ReportError if it is none."""
    if not run_dir.is_dir():
        raise ReportError(f"{run_dir}: there is no such folder")
    if not is_run([path.name for path in run_dir.iterdir()]):
        raise ReportError(f"{run_dir}: no run folder; one holds result.json, or config.json and problem.toml")
    return read_run(run_dir, run_dir), read_motions(run_dir)


def read_motions(folder: Path) -> RecordedMotion:
    """Read what there is; the guess is no loss where it is missing."""
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
    """A recorded motion, or ``only`` some arrays of it; None, with a sentence in ``faults``, if there is none."""
    try:
        return read_trajectory(path, only)
    except ReportError as error:
        faults.append(str(error))
        return None


def draw(run: Run, recording: RecordedMotion) -> dict[str, Picture]:
    """Every figure of the page by name; those that have nothing to show are left out."""
    made = style.picture("convergence", "Convergence of this run", draw_run(run))
    made += style.picture("variables", "Variables against their knots", draw_variables(run))
    motion = recording.trajectory
    if motion is not None:
        made += style.picture(
            "motion", "Path and poses over time", draw_motion(motion, recording.scene, recording.guess)
        )
        made += joint_pictures(motion, recording.scene)
        made += style.picture("states", "Position, velocity and angular velocity over time", draw_states(motion))
        made += style.picture("controls", "Forces and torques over time", draw_controls(motion))
        made += style.picture("contacts", "Contact forces and gaps over time", draw_contacts(motion, recording.scene))
    made += style.picture("growth", "Growth of changes until the end", draw_growth(run.examination.growth, motion))
    made += style.picture("energy", "Energy over time", draw_energy(run.examination.energy))
    return {picture.name: picture for picture in made}


def build(run: Run, recording: RecordedMotion, pictures: Mapping[str, Drawn]) -> Html:
    """The page, from the verdict to the sources."""
    cards = [
        sections.checks(run),
        motion_card(run, recording, pictures),
        sections.found(run, pictures),
        trusted(run, pictures),
        stage_card(run),
        card(
            "Convergence",
            figures(only(pictures, "convergence"), how_drawn(run)),
            anchor="convergence",
        ),
        *motion_cards(recording, pictures),
        sections.time_split(run),
        sources(run),
    ]
    header = sections.header(run, cards)
    note = [tag("p", OVERSIZED, class_="note")] if oversized(run) else []
    return join([header, *note, sections.key_numbers(run), *cards])


def how_drawn(run: Run) -> str:
    """The caption of the convergence: what the figure does not show."""
    return f"Pale: the lowest so far{' in its stage' * smoothed(run.stages)}. Work counts one rollout as 1."


def motion_card(run: Run, recording: RecordedMotion, pictures: Mapping[str, Drawn]) -> Html:
    """The motion; nothing where there is neither a result nor a motion."""
    if recording.trajectory is None and not run.readable:
        return Html("")
    return sections.motion(recording.trajectory, recording.scene, recording.guess, pictures, recording.faults)


def only(pictures: Mapping[str, Drawn], name: str) -> list[Drawn]:
    """The picture of that name, if it was made."""
    return [pictures[name]] if name in pictures else []


def motion_cards(recording: RecordedMotion, pictures: Mapping[str, Drawn]) -> list[Html]:
    """Joints, gait, states, controls and contacts over time."""
    motion = recording.trajectory
    if motion is None:
        return []
    bodies, touching = len(motion.body_names), by_surfaces(motion)
    states = shortened(len(shown_bodies(motion)), bodies, "bodies", "that move most")
    controlled = len(controlled_bodies(motion))
    acting = shortened(min(controlled, MOST_BODIES), controlled, "bodies", "that come first")
    contacts = shortened(len(shown_pairs(touching)), len(touching.contact_names), "pairs", "with the largest impulses")
    force = "A force is the step's impulse over its duration, so an impact is a spike whose height grows as dt shrinks."
    return [
        joint_card(motion, recording.scene, pictures),
        gait_card(motion, recording.scene, pictures),
        card("States over time", figures(only(pictures, "states"), states), anchor="states"),
        card("Controls", figures(only(pictures, "controls"), acting), anchor="controls"),
        card("Contacts", figures(only(pictures, "contacts"), f"{force} {contacts}"), anchor="contacts"),
    ]


def shortened(shown: int, total: int, noun: str, which: str) -> str:
    """What a figure leaves out; empty if nothing."""
    return f"Shown are {shown} of {total} {noun}: those {which}." if shown < total else ""


def sources(run: Run) -> Html:
    """Provenance: versions, command, and the files that the run was made from."""
    texts = [("Resolved configuration", CONFIG), ("Problem file", PROBLEM), ("Log of the solver", LOG)]
    folds = [sections.source(title, read_text(run.folder / name)) for title, name in texts]
    faults = [tag("p", f"Not read: {'; '.join(run.faults)}.", class_="note")] if run.faults else []
    return card("Where this comes from", sections.provenance(run), *faults, *folds, anchor="provenance")


def read_text(path: Path) -> str:
    """A file's text, JSON set out in lines; empty if it cannot be read."""
    try:
        text = tables.read_words(path)
        return json.dumps(json.loads(text), indent=2, ensure_ascii=False) if path.suffix == ".json" else text
    except (ReportError, RecursionError):
        return ""
    except ValueError:
        return writing.several(len(text), "character") + " that are no JSON:\n" + text
