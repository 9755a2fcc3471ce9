"""``symphys list``: what there is."""

from __future__ import annotations

import click


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
