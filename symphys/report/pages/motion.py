"""A page with one motion: what ``symphys show`` writes."""

from __future__ import annotations

from pathlib import Path

from symphys import files
from symphys.findings.writing import show
from symphys.report.figures import style
from symphys.report.figures.contacts import draw_contacts
from symphys.report.figures.states import draw_controls, draw_states
from symphys.report.pages import sections
from symphys.report.pages.joints import gait_card, joint_card, joint_pictures
from symphys.report.pages.markup import card, figures, join, page, tag
from symphys.report.scene.motion import draw_motion
from symphys.results.file_names import FIGURES
from symphys.results.scene import Scene, read_scene
from symphys.results.trajectories import read_trajectory
from symphys.trajectory import Trajectory


def write_motion(trajectory_npz: Path, scene_json: Path, out: Path, title: str = "Motion") -> Path:
    """Write a page that plays and draws a recorded motion, and its figures as SVG and CSV beside it.

    Args:
        trajectory_npz: as in a run folder.
        scene_json: as in a run folder.
        out: the page to write, for instance ``motion.html``.
        title: heading of the page.

    Returns:
        ``out``.

    Raises:
        ReportError: a file cannot be read or written.
    """
    return write_motion_page(read_trajectory(trajectory_npz), read_scene(scene_json), out, title)


def write_motion_page(trajectory: Trajectory, scene: Scene, out: Path, title: str = "Motion") -> Path:
    """Write the page of a motion that is at hand; see ``write_motion``."""
    with style.paper():
        pictures = draw(trajectory, scene)
    style.write_figures(out.parent / FIGURES, pictures.values())
    body = join(
        [
            tag("p", "Simulated motion", class_="kicker"),
            tag("h1", title),
            tag("p", summary(trajectory), class_="lead"),
            sections.motion(trajectory, scene, None, pictures, ()),
            joint_card(trajectory, scene, pictures),
            gait_card(trajectory, scene, pictures),
            *(card(name, figures([pictures[key]])) for key, name in CARDS if key in pictures),
        ]
    )
    files.write_text(out, page(title, body, animated=True))
    return out


CARDS = (("states", "States over time"), ("controls", "Controls"), ("contacts", "Contacts"))


def draw(trajectory: Trajectory, scene: Scene) -> dict[str, style.Picture]:
    """Every figure by name."""
    made = style.picture("motion", "Path and poses over time", draw_motion(trajectory, scene))
    made += joint_pictures(trajectory, scene)
    made += style.picture("states", "Position, velocity and angular velocity over time", draw_states(trajectory))
    made += style.picture("controls", "Forces and torques over time", draw_controls(trajectory))
    made += style.picture("contacts", "Contact forces and gaps over time", draw_contacts(trajectory, scene))
    return {picture.name: picture for picture in made}


def summary(trajectory: Trajectory) -> str:
    """Duration, steps and bodies."""
    duration = trajectory.time[-1] - trajectory.time[0]
    steps, bodies = len(trajectory.time) - 1, len(trajectory.body_names)
    return f"{show(duration, 4)} s in {steps} steps; {bodies} {'body' if bodies == 1 else 'bodies'}."
