"""Charts of what a solver did and found: convergence, variables, growth and energy, as the figures show them."""

from __future__ import annotations

import numpy as np

from symphys.findings.examination import Energy, Growth
from symphys.report.charts.chart import Chart, Line, Panel, lines
from symphys.report.figures import style
from symphys.report.figures.convergence import AXIS_TITLES
from symphys.report.figures.history import HistoryPanel, exact_ends, segments, shown_panels, work_of
from symphys.report.figures.variables import MOST_PANELS, component_colours, component_names, knotted, near_bounds
from symphys.report.figures.verification import MOST_TOUCHES, energy_lines, known_growth, touches
from symphys.results.result import VariableRecord, smoothed
from symphys.results.run import Run
from symphys.trajectory import Trajectory
from symphys.types import Array

COLUMNS = 3


def run_charts(run: Run, motion: Trajectory | None) -> list[Chart]:
    """All that there are."""
    found = [convergence_chart(run), variables_chart(run)]
    found += [growth_chart(run.examination.growth, motion), energy_chart(run.examination.energy)]
    return [chart for chart in found if chart is not None]


def convergence_chart(run: Run) -> Chart | None:
    """Objective, errors, gradient norm, step, reported quantities; None without two iterations."""
    shown = shown_panels(run)
    if run.trace.rows < 2 or not shown:
        return None
    x, along = work_of(run)
    colour = style.solver_marks([run.solver])[run.solver][0]
    panels = tuple(history_panel(run, x, along, panel, colour) for panel in shown)
    keys = (("at the stage's own smoothing", colour), ("exact, at its end", style.INK)) * smoothed(run.stages)
    return Chart(
        "convergence", "Convergence of this run", panels, 2 if len(panels) == 4 else min(len(panels), COLUMNS), keys
    )


def history_panel(run: Run, x: Array, along: str, panel: HistoryPanel, colour: str) -> Panel:
    """One column against the work, with a gap between stages, and the exact ends of stages."""
    values = np.maximum(panel.values, panel.floor) if panel.relative else panel.values
    drawn: list[Line] = []
    for part in segments(run):
        if panel.best is not None and np.any(panel.best[part] < values[part]):
            drawn += lines(x[part], panel.best[part, None], ["lowest so far"], [colour], width=2.4, look="pale")
        drawn += lines(x[part], values[part, None], [panel.title], [colour])
    ends = exact_ends(run, x, panel.exact) if smoothed(run.stages) and panel.exact else []
    for met in (True, False):
        if marks := [(at, max(exact, panel.floor) if panel.relative else exact) for at, exact, m in ends if m is met]:
            at, exact = np.array(marks).T
            drawn.append(Line("exact", style.INK, at, exact, look="dots" if met else "rings"))
    heights = np.concatenate([values, *(line.y for line in drawn)])
    scale = style.scale_of(heights)
    if panel.relative and np.any(heights > 0):
        scale = -1.0
    return Panel(panel.title, tuple(drawn), AXIS_TITLES.get(along, along), scale, met=panel.relative)


def variables_chart(run: Run) -> Chart | None:
    """A panel for each variable with knots; None without any."""
    shown = knotted(run)[:MOST_PANELS]
    if not shown:
        return None
    return Chart("variables", "Variables against their knots", tuple(map(variable_panel, shown)), 1)


def variable_panel(variable: VariableRecord) -> Panel:
    """The components against the number of the knot, found and at the guess, and bounds that are near."""
    knots = np.arange(1, variable.value.shape[1] + 1, dtype=float)
    colours = component_colours()
    names = [name or variable.name for name in component_names(variable)][: len(colours)]
    few = variable.value[: len(names)].T
    guess = lines(knots, variable.guess[: len(names)].T, [f"{n} at the guess" for n in names], colours, width=0.9,
                  look="dashed")  # fmt: skip
    title = f"{variable.name}  ({style.short(', '.join(variable.sets), 60)})"
    return Panel(title, guess + lines(knots, few, names, colours), "knot", edges=tuple(near_bounds(variable).tolist()))


def growth_chart(growth: Growth, motion: Trajectory | None) -> Chart | None:
    """|dx_T/dx_t| against t, with a tick where a contact begins; None without two numbers."""
    time, factor = known_growth(growth)
    if time.size < 2:
        return None
    drawn = lines(time, factor[:, None], ["growth"], [style.BODIES[0]])
    ticks = () if motion is None else tuple(touches(motion).tolist())
    ticks = ticks if len(ticks) <= MOST_TOUCHES else ()
    panel = Panel("Growth of a change at t until the end", drawn, "time t [s]", -1.0, edges=(1.0,), ticks=ticks)
    return Chart("growth", "Growth of changes until the end", (panel,))


def energy_chart(energy: Energy) -> Chart | None:
    """Kinetic, potential and total energy against time; None where it was not recorded."""
    found = energy_lines(energy)
    if not found:
        return None
    values = np.stack([values for _, values, *_ in found], axis=1)
    names, colours = [name for name, *_ in found], [colour for _, _, colour, _ in found]
    drawn = lines(energy.time, values, names, colours)
    keys = tuple(zip(names, colours, strict=True))
    return Chart("energy", "Energy over time", (Panel("Energy [J]", drawn, "time [s]"),), keys=keys)
