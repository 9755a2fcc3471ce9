"""``symphys list`` and ``symphys new``: the shipped problems, and copies of them."""

from __future__ import annotations

from pathlib import Path

import click

from symphys.cli.arguments import complete_problem


@click.command("list")
def listing() -> None:
    """List the shipped problems, the robots and tasks that problems include, and the solvers."""
    from symphys import problems
    from symphys.problem import load_problem
    from symphys.solvers import SOLVERS

    click.echo("problems:")
    for name, path in problems.catalogue().items():
        click.echo(f"  {name:<20} {load_problem(path).title}")
    click.echo("robots and tasks, for [[include]]:")
    for file in problems.parts():
        click.echo(f"  {file}")
    click.echo("solvers:")
    for solver in SOLVERS.values():
        click.echo(f"  {solver.name:<20} {solver.summary}")


@click.command()
@click.argument("file", type=click.Path(path_type=Path, dir_okay=False))
@click.option(
    "--from",
    "source",
    default="ball_throw",
    show_default=True,
    metavar="NAME",
    shell_complete=complete_problem,
    help="A shipped problem, robot or task (see `symphys list`).",
)
def new(file: Path, source: str) -> None:
    """Write a copy of a shipped problem, robot or task, to be changed.

    What it includes is found from anywhere. A file that is there already is not overwritten.
    """
    from symphys import problems
    from symphys.api.tools import new as copy

    copy(file, source)
    if problems.is_part(problems.shipped(source)):
        click.echo(f'{file}: to be included in a problem, by [[include]] with file = "{file.name}"')
    else:
        click.echo(f"{file}: try `symphys show {file}`, then `symphys check {file}` and `symphys solve {file}`")
