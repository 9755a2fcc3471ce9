"""``symphys ls``: the table of all runs below a folder."""

from __future__ import annotations

from pathlib import Path

import click

from symphys.cli.arguments import REPORTS
from symphys.cli.run_tables import ReadingProgress, format_options, print_rows, read_columns, summary, where_option


@click.command()
@click.argument("folder", metavar="[DIR]", type=click.Path(path_type=Path), default=REPORTS)
@where_option
@click.option("--sort", metavar="KEY", help="Sort by a column; -KEY: the largest first. Several with commas.")
@click.option("--limit", type=click.IntRange(1), metavar="N", help="Print at most so many runs.")
@format_options
def ls(
    folder: Path,
    conditions: tuple[str, ...],
    sort: str | None,
    limit: int | None,
    names: str | None,
    as_csv: bool,
    as_json: bool,
) -> None:
    """List all runs below DIR, which is `reports` if it is left out.

    A run whose files cannot be read is listed with the file and the reason.
    """
    from symphys.results.table import chosen, ordered, read_rows

    with ReadingProgress() as tell:
        found = read_rows(folder, tell)
    rows = chosen(found.rows, conditions)
    if sort:
        rows = ordered(rows, sort)
    print_rows(rows[:limit], found, read_columns(names, found), as_csv, as_json)
    if not (as_csv or as_json):
        left_out = f" ({limit:,} shown)" if limit and limit < len(rows) else ""
        click.echo(f"\n{summary(rows)}{left_out}")
