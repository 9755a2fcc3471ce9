"""``symphys check``: validate a file, and examine gradient and motion at the guess."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from symphys.cli.arguments import UsageFault, complete_problem, read_problems, read_settings, settings_option
from symphys.findings.writing import several

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from symphys.problem import Constraint, Cost, Problem, Target
    from symphys.transcription import Transcription

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
    help="Examine the solution of this run instead of the guess.",
)
def check(source: str, assignments: tuple[str, ...], folder: Path | None) -> int:
    """Validate a problem file and examine its gradient and motion at the guess.

    Exit code 1: the gradient disagrees with differences, a check says "do not rely on it", or something is not finite.
    """
    from symphys.cli.examined import Examined, print_examined
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
