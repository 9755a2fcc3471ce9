"""Charts of a recorded motion: joints, gait, states, controls and contacts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symphys.findings.writing import capital
from symphys.report.charts import palette
from symphys.report.charts.chart import Chart, Key, Line, Panel
from symphys.report.charts.contacts import contacts_chart
from symphys.report.charts.tables import TIME, vector
from symphys.report.robots.gait import gait_chart
from symphys.report.robots.joint_charts import joint_charts
from symphys.report.scene.views import NAMES
from symphys.results.scene import Scene
from symphys.trajectory import Trajectory
from symphys.types import Array

MOST_BODIES = 5
Quantity = tuple[str, str, Array, Array]
"""Name, unit, times, and values (times, B, 3)."""


def motion_charts(trajectory: Trajectory, scene: Scene) -> list[Chart]:
    """Chart a motion; what it does not have is left out."""
    found = [*joint_charts(trajectory, scene), gait_chart(trajectory, scene), states_chart(trajectory)]
    found += [controls_chart(trajectory), contacts_chart(trajectory, scene)]
    return [chart for chart in found if chart is not None]


def shown_bodies(trajectory: Trajectory) -> list[int]:
    """Choose the bodies that get a row: those that move most, in the file's order."""
    travel = np.abs(np.diff(trajectory.position, axis=0)).sum(axis=(0, 2))
    most = sorted(np.argsort(-travel, kind="stable")[:MOST_BODIES])
    return [int(body) for body in most]


def controlled_bodies(trajectory: Trajectory) -> list[int]:
    """Return the bodies on which a force or torque acts at any time."""
    acting = np.abs(np.concatenate([trajectory.force, trajectory.torque], axis=2)).sum(axis=(0, 2))
    return [int(body) for body in np.flatnonzero(acting > 0)]


def states_chart(trajectory: Trajectory) -> Chart:
    """Chart position, velocity and angular velocity of ``shown_bodies``."""
    alt = "Position, velocity and angular velocity over time"
    quantities = [
        ("position", "m", trajectory.time, trajectory.position),
        ("velocity", "m/s", trajectory.time, trajectory.velocity),
        ("angular_velocity", "rad/s", trajectory.time, trajectory.angular_velocity),
    ]
    return body_chart("states", alt, trajectory, shown_bodies(trajectory), quantities)


def controls_chart(trajectory: Trajectory) -> Chart | None:
    """Chart the forces and torques that act on bodies; None where none does."""
    bodies, starts = controlled_bodies(trajectory)[:MOST_BODIES], trajectory.time[:-1]
    quantities = [("force", "N", starts, trajectory.force), ("torque", "N m", starts, trajectory.torque)]
    acting = [quantity for quantity in quantities if np.any(quantity[3] != 0)]
    return body_chart("controls", "Forces and torques over time", trajectory, bodies, acting) if bodies else None


def body_chart(
    name: str, alt: str, trajectory: Trajectory, bodies: Sequence[int], quantities: Sequence[Quantity]
) -> Chart:
    """Chart x, y, z of quantities: a row for each body, a column for each quantity."""
    panels, tables, names = list[Panel](), [], trajectory.body_names
    for body in bodies:
        for quantity, unit, time, values in quantities:
            words = f"{quantity.replace('_', ' ')} [{unit}]"
            title = f"{names[body]}: {words}" if len(names) > 1 else capital(words)
            looks = zip(NAMES, palette.AXES, values[:, body].T, palette.AXIS_WIDTHS, strict=True)
            drawn = tuple(Line(axis, colour, time, column, width) for axis, colour, column, width in looks)
            panels.append(Panel(title, drawn, TIME))
            tables.append({TIME: time, **vector(f"{names[body]}.{quantity}", unit, values[:, body])})
    keys = tuple(Key(axis, colour) for axis, colour in zip(NAMES, palette.AXES, strict=True))
    return Chart(name, alt, tuple(panels), len(quantities), keys, tuple(tables))
