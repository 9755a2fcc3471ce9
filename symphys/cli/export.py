"""``symphys export``: a problem for other programs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from symphys.cli.arguments import UsageFault, read_problems, read_settings, settings_option
from symphys.version import __version__

if TYPE_CHECKING:
    from symphys.problem import Problem

FOLDER = click.Path(path_type=Path, file_okay=False)


@click.command()
@click.argument("source", metavar="FILE")
@click.option("--c", "c", type=FOLDER, metavar="DIR", help="Folder for C sources: step, rollout and gradient.")
@click.option("--casadi", type=FOLDER, metavar="DIR", help="Folder for functions that plain casadi loads.")
@click.option(
    "--mjcf", type=FOLDER, metavar="DIR", help="Folder for a model file of MuJoCo: bodies, joints, the start."
)
@settings_option
def export(source: str, c: Path | None, casadi: Path | None, mjcf: Path | None, assignments: tuple[str, ...]) -> None:
    """Write a problem as plain C sources, as casadi functions, or as a model for MuJoCo, that need no symphys.

    Files that symphys did not write, or that were changed since, are not overwritten.
    """
    if c is None and casadi is None and mjcf is None:
        raise UsageFault("export: say what to write, --c DIR, --casadi DIR or --mjcf DIR")
    from symphys.export import write_folders

    (problem,) = read_problems([source], read_settings(assignments))
    folders: dict[Path, dict[str, bytes]] = {}
    for folder, contents in written(problem, c, casadi, mjcf):
        folders[folder] = folders.get(folder, {}) | contents
    for path in write_folders(folders):
        click.echo(path)


def written(
    problem: Problem, c: Path | None, casadi: Path | None, mjcf: Path | None
) -> Iterator[tuple[Path, dict[str, bytes]]]:
    """What goes into each folder; a model asks for nothing to be solved."""
    from symphys.export import c_files, casadi_files, mjcf_files
    from symphys.problem import require_solvable
    from symphys.transcription import transcribe
    from symphys.transcription.network_rollout import require_small_nets

    if c is not None or casadi is not None:
        require_solvable(problem)
        require_small_nets(problem, "export")
        transcription = transcribe(problem, backend="casadi")
    if c is not None:
        yield c, c_files(transcription, __version__)
    if casadi is not None:
        yield casadi, casadi_files(transcription, __version__)
    if mjcf is not None:
        yield mjcf, mjcf_files(problem)
