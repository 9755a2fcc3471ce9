"""``symphys report``: make reports again."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
def report(folder: Path) -> None:
    """Make the report of a run folder, or of all runs below a folder, again from its files alone."""
    from symphys.report import write_pages

    for page in write_pages(folder):
        click.echo(page)
