"""Charts of a recorded motion: joints, gait, states, controls and contacts, as the figures of those names show them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symphys.findings.writing import percent
from symphys.report.charts.chart import Bars, Chart, Line, Panel, lines
from symphys.report.figures import style
from symphys.report.figures.contacts import by_surfaces, force_parts, force_scale, pair_normals, shown_pairs
from symphys.report.figures.states import MOST_BODIES as MOST_CONTROLLED
from symphys.report.figures.states import (
    Quantity,
    control_quantities,
    controlled_bodies,
    shown_bodies,
    state_quantities,
)
from symphys.report.robots.branches import colours
from symphys.report.robots.gait import has_gait, shown_stances, spans, stances
from symphys.report.robots.joint_figures import (
    FULL,
    TARGET,
    axis_range,
    colour_of,
    least_range,
    make_grid,
    shown,
)
from symphys.report.robots.joint_use import Channel, channels
from symphys.report.scene.views import NAMES
from symphys.results.scene import Scene
from symphys.trajectory import Trajectory

TIME = "time [s]"


def motion_charts(trajectory: Trajectory, scene: Scene) -> list[Chart]:
    """All that there are."""
    found = [*joint_charts(trajectory, scene), gait_chart(trajectory, scene), states_chart(trajectory)]
    found += [controls_chart(trajectory), contacts_chart(trajectory, scene)]
    return [chart for chart in found if chart is not None]


def states_chart(trajectory: Trajectory) -> Chart:
    """Position, velocity and angular velocity of the bodies that move most."""
    alt = "Position, velocity and angular velocity over time"
    return body_chart("states", alt, trajectory, shown_bodies(trajectory), state_quantities(trajectory))


def controls_chart(trajectory: Trajectory) -> Chart | None:
    """Forces and torques that act on bodies; None where none does."""
    bodies = controlled_bodies(trajectory)[:MOST_CONTROLLED]
    if not bodies:
        return None
    return body_chart("controls", "Forces and torques over time", trajectory, bodies, control_quantities(trajectory))


def body_chart(
    name: str, alt: str, trajectory: Trajectory, bodies: Sequence[int], quantities: Sequence[Quantity]
) -> Chart:
    """A row for each body, a column for each quantity, its x, y, z."""
    named = len(trajectory.body_names) > 1
    panels = [
        Panel(
            f"{trajectory.body_names[body]}: {what} [{unit}]" if named else f"{what.capitalize()} [{unit}]",
            lines(time, values[:, body], NAMES, style.AXES),
            TIME,
        )
        for body in bodies
        for what, unit, time, values in ((each[0].replace("_", " "), *each[1:]) for each in quantities)
    ]
    return Chart(name, alt, tuple(panels), len(quantities), tuple(zip(NAMES, style.AXES, strict=True)))


def contacts_chart(trajectory: Trajectory, scene: Scene) -> Chart | None:
    """Force and gap of the pairs with the largest impulses; None without pairs."""
    trajectory = by_surfaces(trajectory)
    pairs = shown_pairs(trajectory)
    if not pairs or len(trajectory.time) < 2:
        return None
    normals = dict(pair_normals(trajectory, scene))
    panels: list[Panel] = []
    keys: dict[str, str] = {}
    for pair in pairs:
        name = trajectory.contact_names[pair]
        middles, parts = force_parts(trajectory, pair, normals.get(name))
        keys |= {kind: colour for kind, colour, _ in parts}
        values = np.stack([column for _, _, column in parts], axis=1)
        drawn = lines(middles, values, [kind for kind, _, _ in parts], [c for _, c, _ in parts], look="steps")
        panels.append(Panel(f"{name}: force [N]", drawn, TIME, force_scale(values), least=(0.0,)))
        gap = lines(trajectory.time, trajectory.contact_gap[:, [pair]], ["gap"], [style.GREY])
        panels.append(Panel(f"{name}: gap [m]", gap, TIME, edges=(0.0,)))
    return Chart("contacts", "Contact forces and gaps over time", tuple(panels), 2, tuple(keys.items()))


def joint_charts(trajectory: Trajectory, scene: Scene) -> list[Chart]:
    """Coordinates of joints, and torques of motors."""
    every = shown(channels(trajectory, scene))
    if not every or len(trajectory.time) < 2:
        return []
    charts = [grid_chart("joints", "Coordinates of joints over time", every, trajectory, scene)]
    if driven := [channel for channel in every if channel.driven]:
        charts.append(grid_chart("motors", "Torques of motors over time", driven, trajectory, scene))
    return charts


def grid_chart(name: str, alt: str, every: Sequence[Channel], trajectory: Trajectory, scene: Scene) -> Chart:
    """A small panel for each coordinate, in the places of the figure."""
    grid = make_grid(every, trajectory, scene)
    draw = value_panel if name == "joints" else torque_panel
    panels = [
        None if channel is None else draw(channel, trajectory, colour_of(channel, trajectory, scene))
        for row in grid
        for channel in row
    ]
    targets = name == "joints" and any(channel.target is not None for channel in every)
    full = name == "motors" and any(channel.share > 0 for channel in every)
    keys = (("command of the servo", TARGET),) * targets + (("saturated", FULL),) * full
    return Chart(name, alt, tuple(panels), max(map(len, grid)), keys)


def value_panel(channel: Channel, trajectory: Trajectory, colour: str) -> Panel:
    """The coordinate, a servo's target, and its limits."""
    target = [] if channel.target is None else [np.append(channel.target, channel.target[-1])]
    limits = [channel.joint.lower, channel.joint.upper]
    low, high = axis_range(np.concatenate([channel.value, *target]), limits, least_range(channel))
    value = channel.value
    drawn = lines(trajectory.time, value[:, None], [channel.quantity], [colour])
    if target:
        drawn += lines(trajectory.time, target[0][:, None], ["command"], [TARGET], width=1.0, look="dashed")
    edges = tuple(edge for edge in limits if low <= edge <= high)
    return Panel(f"{channel.name} [{channel.unit}]", drawn, TIME, edges=edges, least=(low, high))


def torque_panel(channel: Channel, trajectory: Trajectory, colour: str) -> Panel:
    """What the motor gives, its bounds, and where it is at them."""
    bounds = (-channel.bound, channel.bound) if np.isfinite(channel.bound) else (0.0,)
    steps = trajectory.time[:-1]
    drawn = lines(steps, channel.torque[:, None], [channel.effort], [colour], look="steps")
    if channel.share > 0:
        ends = [(trajectory.time[[a, b]], sign) for sign in (-1, 1) for a, b in saturations(channel, sign)]
        times = np.concatenate([np.append(time, time[-1]) for time, _ in ends])
        full = np.concatenate([[sign * channel.bound, sign * channel.bound, np.nan] for _, sign in ends])
        drawn += (Line("saturated", FULL, times, full, 2.4),)
    share = f", saturated {percent(channel.share)}" if channel.share > 0 else ""
    return Panel(f"{channel.name} [{channel.torque_unit}]{share}", drawn, TIME, edges=bounds)


def saturations(channel: Channel, sign: int) -> list[tuple[int, int]]:
    """From which step until which the motor gives the most that it can to one side."""
    return spans(channel.saturated & (sign * channel.torque > 0))


def gait_chart(trajectory: Trajectory, scene: Scene) -> Chart | None:
    """When which body stands; None where none comes down or leaves the ground."""
    found = stances(trajectory, scene)
    if not has_gait(found):
        return None
    colour, time = colours(trajectory, scene), trajectory.time
    bars = tuple(
        Bars(
            trajectory.body_names[stance.body],
            colour[stance.body],
            tuple((round(float(time[a]), 6), round(float(time[b]), 6)) for a, b in spans(stance.stands)),
            percent(stance.duty),
        )
        for stance in shown_stances(found)
    )
    ends = (float(time[0]), float(time[-1]))
    return Chart(
        "gait",
        "Which feet stand on the ground, over time",
        (Panel("On the ground, and the duty factor", (), TIME, bars=bars, least=ends),),
    )
