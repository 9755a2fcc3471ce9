"""``symphys export``: a problem for other programs."""

from __future__ import annotations

from pathlib import Path

import click

from symphys.cli.arguments import UsageFault, complete_problem, read_problems, read_settings, settings_option

FOLDER = click.Path(path_type=Path, file_okay=False)


@click.command()
@click.argument("source", metavar="FILE", shell_complete=complete_problem)
@click.option("--c", "c", type=FOLDER, metavar="DIR", help="Folder for C sources: step, rollout and gradient.")
@click.option("--casadi", type=FOLDER, metavar="DIR", help="Folder for functions that plain casadi loads.")
@click.option("--mjcf", type=FOLDER, metavar="DIR", help="Folder for a MuJoCo model: bodies, joints, initial state.")
@click.option("--approximate", is_flag=True, help="Leave out of the MuJoCo model what MuJoCo does not support.")
@settings_option
def export(
    source: str,
    c: Path | None,
    casadi: Path | None,
    mjcf: Path | None,
    approximate: bool,
    assignments: tuple[str, ...],
) -> None:
    """Export a problem as C sources, casadi functions or a MuJoCo model.

    Files that symphys did not write, or that were changed since, are not overwritten. What a model for MuJoCo
    approximates or leaves out stands in its first lines, and is printed.
    """
    given = {"c": c, "casadi": casadi, "mjcf": mjcf}
    asked = {kind: folder for kind, folder in given.items() if folder is not None}
    if not asked:
        raise UsageFault("export: say what to write, --c DIR, --casadi DIR or --mjcf DIR")
    from symphys.export.writing import write

    (problem,) = read_problems([source], read_settings(assignments))
    made = write(problem, asked, approximate)
    for departure in made.departures:
        click.echo(departure, err=True)
    for path in made.paths:
        click.echo(path)
