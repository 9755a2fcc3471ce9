"""``symphys report``: make reports again."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
def report(folder: Path) -> None:
    """Make the report of a run folder, or of all runs below a folder, again from its files alone."""
    from symphys.report import write_batch_report, write_run_report
    from symphys.results.discovery import run_folders

    below = run_folders(folder)
    for run in below:
        click.echo(write_run_report(run))
    if below != [folder]:
        click.echo(write_batch_report(folder))
