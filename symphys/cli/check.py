"""``symphys check``: is the file valid, and its gradient right?"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from symphys.cli.arguments import read_problems, read_settings, settings_option
from symphys.cli.wording import number

if TYPE_CHECKING:
    from symphys.problem import Problem

TOLERANCE = 1e-4
"""Largest |gradient - central difference| of a variable, relative to the norm of its gradient, that counts as right."""


@click.command()
@click.argument("source", metavar="FILE")
@settings_option
def check(source: str, assignments: tuple[str, ...]) -> int:
    """Validate a problem file, and compare its gradient at the guess with central differences."""
    from symphys.problem import require_solvable
    from symphys.runs import check_tables
    from symphys.transcription import transcribe
    from symphys.trust import compare_gradient

    (problem,) = read_problems([source], read_settings(assignments))
    check_tables(problem)
    click.echo("\n".join(describe(problem)))
    require_solvable(problem)
    transcription = transcribe(problem, backend="casadi")
    compared = compare_gradient(transcription, transcription.shooting.start(0))
    wrong = [row["variable"] for row in compared if not row["error"] <= TOLERANCE]
    print_comparison(compared)
    if wrong:
        click.echo(
            f"the gradient disagrees at the guess in {', '.join(wrong)}: it may lie on a kink; try another guess"
        )
        return 1
    return 0


def describe(problem: Problem) -> list[str]:
    """What the file contains, in lines."""
    world, simulation = problem.world(), problem.simulation
    lines = [
        f"{problem.name}: {problem.title}",
        f"  time         {simulation.duration:g} s in {simulation.steps} steps of {simulation.dt:g} s",
        f"  bodies       {listed(body.name for body in world.bodies)}",
        f"  planes       {listed(plane.name for plane in world.statics)}",
        f"  contacts     {listed(pair.name for pair in world.pairs)}",
    ]
    for variable in problem.variables:
        sets = listed(slot.name for slot in variable.slots)
        lines.append(f"  variable     {variable.name}: {variable.guess.size} numbers, sets {sets}")
    for kind, things in (("cost", problem.costs), ("target", problem.targets), ("constraint", problem.constraints)):
        lines += [f"  {kind:<12} {thing.name}: {thing.formula.text} ({moment(thing.at)})" for thing in things]
    return lines


def listed(names: Any) -> str:
    """Names with commas."""
    return ", ".join(names) or "none"


def moment(at: str | float) -> str:
    """When something is looked at."""
    return at if isinstance(at, str) else f"at {at:g} s"


def print_comparison(compared: list[dict[str, Any]]) -> None:
    """Print one row per variable."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    caption = "the gradient at the guess against central differences"
    table = Table(box=SIMPLE_HEAD, caption=caption, caption_justify="left")
    table.add_column("variable")
    table.add_column("norm of gradient", justify="right")
    table.add_column("relative error", justify="right")
    table.add_column("")
    for row in compared:
        fine = row["error"] <= TOLERANCE
        verdict = Text("agrees", style="green") if fine else Text("disagrees", style="red")
        table.add_row(Text(row["variable"]), number(row["scale"]), number(row["error"]), verdict)
    Console().print(table)
