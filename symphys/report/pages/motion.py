"""What a page shows of a motion: played and drawn, with joints, gait, states, controls and contacts.

``symphys show`` writes a page with a motion alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from symphys import files
from symphys.findings.writing import beside, listed, percent, several, show
from symphys.report.charts.chart import Chart
from symphys.report.charts.contacts import by_surfaces, shown_pairs
from symphys.report.charts.motion import MOST_BODIES, controlled_bodies, motion_charts, shown_bodies
from symphys.report.pages.markup import Html, Part, card, figures, join, named_figure, page, pill, table, tag
from symphys.report.robots.gait import LOADED_SHARE, stances, weight
from symphys.report.robots.joint_charts import shown
from symphys.report.robots.joint_use import Channel, channels, separation
from symphys.report.scene.animation import Film, animation
from symphys.results.scene import Scene, read_scene
from symphys.results.scene_joints import SceneMotor
from symphys.results.trajectories import read_trajectory
from symphys.trajectory import Trajectory

OFTEN_SATURATED = 0.25
"""A motor that is saturated for this share of the time is marked in the table."""
MOST_ROWS = 60
ROUNDING = 1e-9
"""[m] below which joints hold."""
MOST_NAMED = 4
HEADER = ("joint", "moves over", "limits", "motor", "largest torque or force", "saturated")
HOW_FORCED = (
    "A force is the step's impulse over its duration, so an impact is a spike whose height grows as dt shrinks."
)


def write_motion(trajectory_npz: Path, scene_json: Path, out: Path, title: str = "Motion") -> Path:
    """Write a page that plays and draws a recorded motion.

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
    """Write the page of a motion that is at hand; arguments and errors are those of ``write_motion``."""
    charts = {chart.name: chart for chart in motion_charts(trajectory, scene)}
    duration, steps = trajectory.time[-1] - trajectory.time[0], len(trajectory.time) - 1
    bodies = several(len(trajectory.body_names), "body", "bodies")
    body = join(
        [
            tag("p", "Simulated motion", class_="kicker"),
            tag("h1", title),
            tag("p", f"{show(duration, 4)} s in {steps} steps; {bodies}.", class_="lead"),
            motion_card(trajectory, scene),
            *motion_cards(trajectory, scene, charts),
        ]
    )
    files.write_text(out, page(title, body))
    return out


def motion_card(
    trajectory: Trajectory | None,
    scene: Scene,
    guess: Trajectory | None = None,
    faults: Sequence[str] = (),
    film: Film | None = None,
) -> Html:
    """Show the motion played, with the path of its guess and motions along the solve, or say why there is none."""
    notes = tag("p", "Not read: " + "; ".join(faults) + ".", class_="note") if faults else Html("")
    played = (
        tag("p", "This run recorded no motion.")
        if trajectory is None
        else animation(trajectory, scene, guess, film=film)
    )
    return card("The motion", played, notes, anchor="motion")


def motion_cards(motion: Trajectory, scene: Scene, charts: Mapping[str, Chart]) -> list[Html]:
    """Show joints, gait, states, controls and contacts over time."""
    bodies, touching = len(motion.body_names), by_surfaces(motion)
    states = shortened(len(shown_bodies(motion)), bodies, "bodies", "that move most")
    controlled = len(controlled_bodies(motion))
    acting = shortened(min(controlled, MOST_BODIES), controlled, "bodies", "that come first")
    contacts = shortened(len(shown_pairs(touching)), len(touching.contact_names), "pairs", "with the largest impulses")
    return [
        joint_card(motion, scene, charts),
        gait_card(motion, scene, charts),
        card("States over time", named_figure(charts, "states", states), anchor="states"),
        card("Controls", named_figure(charts, "controls", acting), anchor="controls"),
        card("Contacts", named_figure(charts, "contacts", f"{HOW_FORCED} {contacts}"), anchor="contacts"),
    ]


def shortened(shown: int, total: int, noun: str, which: str) -> str:
    """Say what a figure leaves out; empty if nothing."""
    return f"Shown are {shown} of {total} {noun}: those {which}." if shown < total else ""


def joint_card(trajectory: Trajectory, scene: Scene, charts: Mapping[str, Chart]) -> Html:
    """Show the coordinates of joints and the torques of motors; empty without joints."""
    every = channels(trajectory, scene)
    drawn = [charts[name] for name in ("joints", "motors") if name in charts]
    few = shown(every)
    left_out = f"Drawn are {len(few)} of {len(every)} coordinates: those that move most." * (len(few) < len(every))
    sentences = [motors_sentence(every), limits_sentence(every), separation_sentence(trajectory)]
    return card(
        "Joints",
        tag("p", " ".join(filter(None, sentences))) if any(sentences) else "",
        figures(drawn, left_out),
        use_table(every),
        anchor="joints",
    )


def motors_sentence(every: Sequence[Channel]) -> str:
    """Say how many motors are saturated, and which most of all."""
    driven = [channel for channel in every if channel.bound > 0]
    full = sorted((c for c in driven if c.share > 0), key=lambda c: -c.share)
    if not driven:
        return ""
    only = len(driven) == 1
    if not full:
        never = "The motor is never saturated: it" if only else "No motor is ever saturated: each"
        return f"{never} could give more at all times."
    if only:
        return f"The motor of {full[0].name} is saturated for {percent(full[0].share)} of the time."
    most = f"{full[0].name}, for {percent(full[0].share)} of the time"
    verb = "is" if len(full) == 1 else "are"
    which = "" if len(full) == 1 else "most of all "
    return f"{len(full)} of {several(len(driven), 'motor')} {verb} saturated at some time, {which}{most}."


def limits_sentence(every: Sequence[Channel]) -> str:
    """Name the joints that reach their limits."""
    names = [channel.name for channel in every if channel.at_limit]
    if not names:
        return ""
    more = [f"{len(names) - MOST_NAMED} more"] if len(names) > MOST_NAMED else []
    return f"{listed([*names[:MOST_NAMED], *more])} {'comes' if len(names) == 1 else 'come'} to a limit."


def separation_sentence(trajectory: Trajectory) -> str:
    """Say how far joints come apart."""
    found = separation(trajectory)
    if found is None:
        return ""
    if found.most < ROUNDING:
        return "Joints hold to rounding."
    where = f" ({found.joint} at t = {show(found.time)} s)"
    return f"Joints come apart by {show(found.rms, 2)} m (root mean square) and {show(found.most, 2)} m at most{where}."


def use_table(every: Sequence[Channel]) -> Html:
    """Return a row for each coordinate."""
    rows = [use_row(channel) for channel in every[:MOST_ROWS]]
    more = f"and {len(every) - MOST_ROWS} more, in trajectory.npz"
    note = tag("p", more, class_="note") if len(every) > MOST_ROWS else ""
    return join([table(HEADER, rows, "tttttt", "Joints"), note]) if rows else Html("")


def use_row(channel: Channel) -> list[Part]:
    """Return the cells of a coordinate."""
    low, high = float(channel.value.min()), float(channel.value.max())
    joint = channel.joint
    return [
        join([channel.name, Html(" "), tag("small", joint.kind)]),
        f"{beside(low, 1.0)} to {beside(high, 1.0)} {channel.unit}",
        limit_words(joint.lower, joint.upper),
        "" if joint.motor is None else motor_words(joint.motor, channel),
        f"{show(float(np.abs(channel.torque).max(initial=0.0)))} {channel.torque_unit}" if channel.driven else "",
        share_words(channel),
    ]


def limit_words(lower: float, upper: float) -> str:
    """Write the limits of a joint; empty where it has none."""
    if math.isfinite(lower) and math.isfinite(upper):
        return f"{show(lower)} to {show(upper)}"
    if math.isfinite(lower):
        return f"from {show(lower)}"
    return f"up to {show(upper)}" if math.isfinite(upper) else ""


def motor_words(motor: SceneMotor, channel: Channel) -> str:
    """Write the kind of a motor and its bounds."""
    speed = f", {show(motor.velocity)} {channel.unit}/s" if math.isfinite(motor.velocity) else ""
    most = f", {show(motor.torque)} {channel.torque_unit}" if math.isfinite(motor.torque) else ""
    return f"{motor.kind}{most}{speed}"


def share_words(channel: Channel) -> Html:
    """Write for how long a motor is saturated."""
    if not channel.bound > 0:
        return Html("")
    if channel.share == 0:
        return tag("small", "never")
    return pill("fair", percent(channel.share)) if channel.share >= OFTEN_SATURATED else Html(percent(channel.share))


def gait_card(trajectory: Trajectory, scene: Scene, charts: Mapping[str, Chart]) -> Html:
    """Show when each foot stands; empty where none comes down or leaves the ground."""
    if "gait" not in charts:
        return Html("")
    least = f"{percent(LOADED_SHARE)} of the weight of {show(weight(trajectory, scene))} N"
    caption = f"A bar: the body carries more than {least}. The duty factor is the share of the time that it does."
    figure = named_figure(charts, "gait", caption)
    return card("Gait", tag("p", steps_sentence(trajectory, scene)), figure, anchor="gait")


def steps_sentence(trajectory: Trajectory, scene: Scene) -> str:
    """Say how many bodies stand at once."""
    found = stances(trajectory, scene)
    at_once = np.sum([stance.stands for stance in found], axis=0)
    most = int(at_once.max())
    aloft = float((at_once == 0).mean())
    air = f"; for {percent(aloft)} of the time none does" if aloft > 0 else ""
    mean = show(float(at_once.mean()), 2)
    stand = "stands" if most == 1 else "stand"
    return f"{several(most, 'body', 'bodies')} at most {stand} at once, {mean} on average{air}."
