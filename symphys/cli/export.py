"""``symphys export``: a problem for other programs."""

from __future__ import annotations

from pathlib import Path

import click

from symphys import __version__
from symphys.cli.arguments import UsageFault, read_problems, read_settings, settings_option

FOLDER = click.Path(path_type=Path, file_okay=False)


@click.command()
@click.argument("source", metavar="FILE")
@click.option("--c", "c", type=FOLDER, metavar="DIR", help="Folder for C sources: step, rollout and gradient.")
@click.option("--casadi", type=FOLDER, metavar="DIR", help="Folder for functions that plain casadi loads.")
@settings_option
def export(source: str, c: Path | None, casadi: Path | None, assignments: tuple[str, ...]) -> None:
    """Write a problem as plain C sources, or as casadi functions, that need no symphys.

    Files that symphys did not write, or that were changed since, are not overwritten.
    """
    if c is None and casadi is None:
        raise UsageFault("export: say what to write, --c DIR or --casadi DIR")
    from symphys.export import c_files, casadi_files, write_folders
    from symphys.problem import require_solvable
    from symphys.transcription import transcribe

    (problem,) = read_problems([source], read_settings(assignments))
    require_solvable(problem)
    transcription = transcribe(problem, backend="casadi")
    folders: dict[Path, dict[str, bytes]] = {}
    if c is not None:
        folders[c] = c_files(transcription, __version__)
    if casadi is not None:
        folders[casadi] = folders.get(casadi, {}) | casadi_files(transcription, __version__)
    for path in write_folders(folders):
        click.echo(path)
