"""Joints and gait on the page of a run: what the figures show, in words and numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from symphys.findings.writing import listed, percent, several, show
from symphys.report.figures.style import Picture, picture
from symphys.report.pages.markup import Drawn, Html, Part, card, figures, join, pill, table, tag
from symphys.report.robots.gait import LOADED, draw_gait, stances, weight
from symphys.report.robots.joint_figures import draw_joints, shown
from symphys.report.robots.joint_use import Channel, channels, separation
from symphys.report.robots.strip import draw_strip
from symphys.results.scene import Scene
from symphys.results.scene_joints import SceneMotor
from symphys.trajectory import Trajectory

OFTEN = 0.25
"""A motor that is saturated for this share of the time is marked in the table."""
MOST_ROWS = 60
MOST_NAMED = 4
HEADER = ("joint", "moves over", "limits", "motor", "largest torque or force", "saturated")


def joint_pictures(trajectory: Trajectory, scene: Scene) -> list[Picture]:
    """Strip, angles, torques and gait, as far as there are."""
    angles, torques = draw_joints(trajectory, scene)
    return [
        *picture("strip", "The motion at even times, from the side and from above", draw_strip(trajectory, scene)),
        *picture("joints", "Coordinates of joints over time", angles),
        *picture("motors", "Torques of motors over time", torques),
        *picture("gait", "Which feet stand on the ground, over time", draw_gait(trajectory, scene)),
    ]


def joint_card(trajectory: Trajectory, scene: Scene, pictures: Mapping[str, Drawn]) -> Html:
    """What joints and motors did; nothing without joints."""
    every = channels(trajectory, scene)
    drawn = [pictures[name] for name in ("joints", "motors") if name in pictures]
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
    """How many motors are saturated, and which most of all."""
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
    """Which joints reach their limits."""
    names = [channel.name for channel in every if channel.at_limit]
    if not names:
        return ""
    more = [f"{len(names) - MOST_NAMED} more"] if len(names) > MOST_NAMED else []
    return f"{listed([*names[:MOST_NAMED], *more])} {'comes' if len(names) == 1 else 'come'} to a limit."


def separation_sentence(trajectory: Trajectory) -> str:
    """How far joints separate."""
    found = separation(trajectory)
    if found is None:
        return ""
    where = f" ({found.joint} at t = {show(found.time)} s)" if found.most > 0 else ""
    return f"Joints come apart by {show(found.rms, 2)} m (root mean square) and {show(found.most, 2)} m at most{where}."


def use_table(every: Sequence[Channel]) -> Html:
    """A row for each coordinate."""
    rows = [use_row(channel) for channel in every[:MOST_ROWS]]
    more = f"and {len(every) - MOST_ROWS} more, in trajectory.npz"
    note = tag("p", more, class_="note") if len(every) > MOST_ROWS else ""
    return join([table(HEADER, rows, "tttttt", "Joints"), note]) if rows else Html("")


def use_row(channel: Channel) -> list[Part]:
    """Its cells."""
    low, high = float(channel.value.min()), float(channel.value.max())
    joint = channel.joint
    bounded = math.isfinite(joint.lower) or math.isfinite(joint.upper)
    return [
        join([channel.name, Html(" "), tag("small", joint.kind)]),
        f"{show(low)} to {show(high)} {channel.unit}",
        f"{show(joint.lower)} to {show(joint.upper)}" if bounded else "",
        "" if joint.motor is None else motor_words(joint.motor, channel),
        f"{show(float(np.abs(channel.torque).max(initial=0.0)))} {channel.torque_unit}" if channel.driven else "",
        share_words(channel),
    ]


def motor_words(motor: SceneMotor, channel: Channel) -> str:
    """Its kind and bounds."""
    speed = f", {show(motor.velocity)} {channel.unit}/s" if math.isfinite(motor.velocity) else ""
    most = f", {show(motor.torque)} {channel.torque_unit}" if math.isfinite(motor.torque) else ""
    return f"{motor.kind}{most}{speed}"


def share_words(channel: Channel) -> Html:
    """How long it is saturated."""
    if not channel.bound > 0:
        return Html("")
    if channel.share == 0:
        return tag("small", "never")
    return pill("fair", percent(channel.share)) if channel.share >= OFTEN else Html(percent(channel.share))


def gait_card(trajectory: Trajectory, scene: Scene, pictures: Mapping[str, Drawn]) -> Html:
    """When which foot stands; nothing where none comes down or leaves the ground."""
    if "gait" not in pictures:
        return Html("")
    least = f"{percent(LOADED)} of the weight of {show(weight(trajectory, scene))} N"
    caption = f"A bar: the body carries more than {least}. The duty factor is the share of the time that it does."
    return card(
        "Gait", tag("p", steps_sentence(trajectory, scene)), figures([pictures["gait"]], caption), anchor="gait"
    )


def steps_sentence(trajectory: Trajectory, scene: Scene) -> str:
    """How many bodies stand at once."""
    found = stances(trajectory, scene)
    at_once = np.sum([stance.stands for stance in found], axis=0)
    most = int(at_once.max())
    aloft = float((at_once == 0).mean())
    air = f"; for {percent(aloft)} of the time none does" if aloft > 0 else ""
    mean = show(float(at_once.mean()), 2)
    stand = "stands" if most == 1 else "stand"
    return f"{several(most, 'body', 'bodies')} at most {stand} at once, {mean} on average{air}."
