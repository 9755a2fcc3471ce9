"""What a notebook and a terminal show of a solution."""

from __future__ import annotations

import html as markup
import io
from collections.abc import Sequence
from pathlib import Path

from symphys.api import figures
from symphys.findings.writing import show
from symphys.results.file_names import TRAJECTORY
from symphys.results.run import Run
from symphys.results.text_files import ReportError
from symphys.results.trajectories import read_trajectory


def line(run: Run) -> str:
    """``<Solution of ball_throw by least_squares: solved, objective 1.2e-06>``."""
    words = run.verdict.replace("_", " ")
    return f"<Solution of {run.problem} by {run.solver}: {words}, objective {show(run.objective)}>"


def html(run: Run) -> str:
    """Verdict, checks and motion; nothing from elsewhere is needed to show it."""
    words = run.verdict.replace("_", " ")
    head = f"<b>{markup.escape(run.title)}</b>: {words} by {markup.escape(run.solver)}, seed {run.seed}"
    lines = [f"<p>{head}; objective {show(run.objective)}, {show(run.seconds.get('solve', 0))} s</p>"]
    if run.checks:
        cells = [
            (each.kind, each.name, show(each.error), show(each.tolerance), "met" if each.met else "missed")
            for each in run.checks
        ]
        lines.append(table(("", "name", "error", "tolerance", ""), cells))
    if not run.solved and run.advice:
        lines.append(f"<p>{markup.escape(run.advice)}</p>")
    return "\n".join([*lines, picture(run.folder)])


def table(header: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """A table of texts."""
    head = "".join(f"<th>{markup.escape(text)}</th>" for text in header)
    body = "".join(f"<tr>{''.join(f'<td>{markup.escape(text)}</td>' for text in row)}</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def picture(folder: Path) -> str:
    """The motion as SVG; empty where there is none."""
    try:
        figure = figures.draw(folder, read_trajectory(folder / TRAJECTORY))
    except ReportError:
        return ""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg")
    _, start, drawing = buffer.getvalue().partition("<svg")
    return f'{start} style="max-width: 100%; height: auto"{drawing}'
