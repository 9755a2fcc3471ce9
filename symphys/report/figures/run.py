"""Every figure of a run as a picture, drawn by matplotlib."""

from __future__ import annotations

from collections.abc import Sequence

from symphys.report.charts.chart import Chart
from symphys.report.figures.drawing import chart_pictures
from symphys.report.figures.style import Picture, paper, picture
from symphys.report.robots.strip import draw_strip
from symphys.report.scene.motion import draw_motion
from symphys.results.scene import Scene
from symphys.trajectory import Trajectory


def draw_figures(
    charts: Sequence[Chart], motion: Trajectory | None, scene: Scene, guess: Trajectory | None = None
) -> list[Picture]:
    """Draw charts, and where there is a motion its path and poses, and a strip of poses."""
    with paper():
        made = chart_pictures(charts)
        if motion is not None:
            made += picture("motion", "Path and poses over time", draw_motion(motion, scene, guess))
            made += picture("strip", "The motion at even times", draw_strip(motion, scene))
    return made
