"""``symphys check``: validate a file, examine gradient and motion at the guess, and print the examination."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from symphys.api.checking import MAX_LINE_WIDTH, TABLE_SUBJECTS
from symphys.api.checking import Examined as Examined
from symphys.cli.arguments import UsageFault, complete_problem, read_problems, read_settings, settings_option
from symphys.findings.advice import NO_SLOPE, VERDICTS, advice, answers, of_influence, slopes
from symphys.findings.levels import BAD, FAIR, GOOD, MARKS, UNKNOWN
from symphys.findings.physics import sliding
from symphys.findings.writing import several

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from symphys.problem import Constraint, Cost, Problem, Target
    from symphys.transcription import Transcription


COLOURS = {GOOD: "green", FAIR: "yellow", BAD: "red", UNKNOWN: "dim"}
WORDS = {text: COLOURS[level] for words in (MARKS, VERDICTS) for level, text in words.items()} | {
    NO_SLOPE: COLOURS[FAIR]
}


def print_examined(examined: Examined) -> None:
    """Print tables, findings and advice."""
    trust, judged = examined.trust, examined.judged
    console = Console(width=None if sys.stdout.isatty() else MAX_LINE_WIDTH)
    if first := of_influence(trust):
        console.print(Text("\n" + printable(first, console)))
    print_table(console, *slopes(trust))
    print_table(console, *answers(trust, judged))
    lines = [line for line in examined.findings if line.about not in TABLE_SUBJECTS]
    rows = [[line.what, line.number, MARKS[line.level], line.meaning] for line in lines]
    print_table(console, ["check", "value", "", "interpretation"], rows)
    for paragraph in (sliding(trust), advice(trust, judged)):
        if paragraph:
            console.print(Text(printable(paragraph, console) + "\n"))


def print_table(console: Console, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table; verdicts, whose column has no title, are not wrapped."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for title in header:
        table.add_column(title, no_wrap=not title, overflow="fold")
    for row in rows:
        table.add_row(*(Text(printable(cell, console), style=WORDS.get(cell, "")) for cell in row))
    console.print(table)


def printable(text: str, console: Console) -> str:
    """Replace characters that the terminal cannot show."""
    return text.encode(console.encoding, "replace").decode(console.encoding)


BUILDING, BUILDING_TAKES = "building the problem", 8.0
"""The part before an examination, and its time relative to the examination's parts."""


@click.command()
@click.argument("source", metavar="FILE", shell_complete=complete_problem)
@settings_option
@click.option(
    "--at",
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="RUN_FOLDER",
    help="Look at what this run of the problem found, instead of the guess.",
)
def check(source: str, assignments: tuple[str, ...], folder: Path | None) -> int:
    """Validate a problem file, and say how far its gradient and its motion can be trusted at the guess.

    Exit code 1: the gradient disagrees with differences, or something is not finite.
    """
    from symphys.cli.watching import working
    from symphys.problem import require_solvable
    from symphys.runs import check_tables
    from symphys.trajectory import NotFinite
    from symphys.transcription import transcribe
    from symphys.verification.examination import PARTS, examine

    (problem,) = read_problems([source], read_settings(assignments))
    check_tables(problem)
    click.echo("\n".join(describe(problem)))
    if problem.recordings and not (problem.costs or problem.targets or problem.constraints):
        click.echo("\nThere is no objective but the recordings, so there is nothing else to examine.")
        return 0
    require_solvable(problem)
    try:
        with working(f"check {problem.name}", {BUILDING: BUILDING_TAKES, **PARTS}) as tell:
            tell(BUILDING)
            transcription = transcribe(problem, backend="casadi")
            z = transcription.shooting.start(0) if folder is None else found(folder, transcription)
            examined = Examined.of(transcription.judge(z), examine(transcription, z, tell))
    except NotFinite as error:
        click.echo(f"\n{error}")
        return 1
    print_examined(examined)
    return 1 if examined.wrong else 0


def found(folder: Path, transcription: Transcription) -> NDArray[Any]:
    """Return the decision vector (n,) that a run found; UsageFault if it is no run of this problem."""
    from symphys.runs import read_result
    from symphys.runs.replay import ReplayError, stored_variables

    try:
        return stored_variables(read_result(folder / "result.json"), transcription)
    except ReplayError as error:
        text = f"{error}; give a folder that `symphys solve` wrote for this file, and the same --set"
        raise UsageFault(f"--at {folder}: {text}") from None


def describe(problem: Problem) -> list[str]:
    """Return the contents of the file, in lines."""
    from symphys.problem import set_quantities
    from symphys.problem.recordings.summary import recording_lines

    world, simulation = problem.world(), problem.simulation
    pairs = dict.fromkeys(pair.name.partition(":")[0] for pair in world.pairs)
    free = ", before a variable sets it" if problem.free_duration else ""
    lines = [
        f"{problem.name}: {problem.title}",
        f"  time         {simulation.duration:g} s in {simulation.steps} steps of {simulation.dt:g} s{free}",
        f"  bodies       {listed(body.name for body in world.bodies)}",
        f"  planes       {listed(plane.name for plane in world.statics)}",
        f"  contacts     {listed(pairs)}",
    ]
    if world.joints:
        lines.append(f"  joints       {listed(f'{joint.name} ({joint.kind.name})' for joint in world.joints)}")
    lines += given(problem)
    for variable in problem.variables:
        numbers = several(variable.guess.size, "number") + " for each recording" * variable.each
        lines.append(f"  variable     {variable.name}: {numbers}, sets {set_quantities(problem, variable)}")
    for line in recording_lines(problem):
        lines.append(f"               {line}" if line.startswith(" ") else f"  recording    {line}")
    for kind, things in (("cost", problem.costs), ("target", problem.targets), ("constraint", problem.constraints)):
        for thing in things:
            formula = " ".join(thing.formula.text.split())
            unit = getattr(thing, "unit", "")
            when = moment(thing) + (f", in {unit}" if unit else "")
            lines.append(f"  {kind:<12} {thing.name}: {formula} ({when})")
    if problem.termination is not None:
        lines.append(f"  over         where {' '.join(problem.termination.margin.text.split())} < 0")
    if problem.scenarios is not None:
        lines.append(f"  differs      {listed(each.name for each in problem.scenarios)}")
    if problem.sweep is not None:
        lines.append(f"  sweep        {problem.sweep.words()}")
    return lines + solvers_of(problem)


def solvers_of(problem: Problem) -> list[str]:
    """Return the solvers of a problem and the reasons for them, in lines."""
    from symphys.runs.choice import chosen

    if problem.solvers:
        return [f"  solvers      {listed(problem.solvers)}, as the file says"]
    aims = problem.costs or problem.targets or problem.constraints
    return [f"  solver       {each}" for each in chosen(problem)] if problem.variables and aims else []


def listed(names: Any) -> str:
    """Join names with commas."""
    return ", ".join(names) or "none"


def moment(thing: Cost | Target | Constraint) -> str:
    """Return when a cost, target or constraint is evaluated."""
    during = getattr(thing, "during", None)
    if during is not None:
        return f"during {during.name}"
    return thing.at if isinstance(thing.at, str) else f"at {thing.at:g} s"


def given(problem: Problem) -> list[str]:
    """Return force laws, references and phases, in lines."""
    lines = []
    for law in problem.forces:
        acted = " against ".join(name for name, _, _ in law.acts_on)
        lines.append(f"  force        {law.name}: {' '.join(law.formula.text.split())}, on {acted}")
    for reference in problem.references:
        names = f"{listed(reference.columns)}, {reference.interpolation}"
        lines.append(f"  reference    {reference.name}: {several(reference.time.size, 'row')} of {names}")
    steps, dt = problem.simulation.steps, problem.simulation.dt
    for phase in problem.phases:
        first, last = phase.ticks(steps)
        numbers = (f"{name} = {row[0] if len(row) == 1 else list(row)}" for name, row in phase.sets.items())
        own = f", with {listed(numbers)}" if phase.sets else ""
        lines.append(f"  phase        {phase.name}: {first * dt:g} s to {last * dt:g} s{own}")
    return lines
