"""``symphys diff``: the differences between two runs."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from symphys.cli.run_tables import text


@click.command()
@click.argument("first", metavar="RUN", type=click.Path(path_type=Path))
@click.argument("second", metavar="RUN", type=click.Path(path_type=Path))
def diff(first: Path, second: Path) -> None:
    """List the differences between two run folders.

    Settings, options, the problem's text, what was found, versions and machines. Times are left out.
    """
    from symphys.results.table.difference import TEXT, differences

    found = differences(first, second)
    if not found:
        click.echo("no difference: the same was asked for, and the same was found")
    part = ""
    for each in found:
        if each.part != part:
            part = each.part
            click.echo(click.style(part, bold=True))
        line = text(str(each))
        click.echo(coloured(line) if part == TEXT else f"  {line}")


def coloured(line: str) -> str:
    """Colour a line of a unified diff."""
    colour = {"+": "green", "-": "red"}.get(line[:1]) if sys.stdout.isatty() else None
    return click.style(line, fg=colour) if colour else line
