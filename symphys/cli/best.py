"""``symphys best``: the best run of each case."""

from __future__ import annotations

from pathlib import Path

import click

from symphys.cli.arguments import REPORTS
from symphys.cli.run_tables import (
    ReadingProgress,
    format_options,
    print_rows,
    read_columns,
    usual_columns,
    where_option,
)


@click.command()
@click.argument("folder", metavar="[DIR]", type=click.Path(path_type=Path), default=REPORTS)
@where_option
@click.option("--overall", is_flag=True, help="One run, the best of all cases.")
@click.option(
    "--by",
    metavar="KEY",
    default="objective",
    show_default=True,
    help="Of runs with equal verdicts the one with the least of this column is best; -KEY: with the most.",
)
@format_options
def best(
    folder: Path,
    conditions: tuple[str, ...],
    overall: bool,
    by: str,
    names: str | None,
    as_csv: bool,
    as_json: bool,
) -> None:
    """List the best run of each case below DIR, which is `reports` if it is left out.

    A case is a problem with its settings. A run is better by its verdict, then by the objective, then by its cost in
    rollouts.
    """
    from symphys.results.table import best as best_of
    from symphys.results.table import chosen, columns, read_rows
    from symphys.results.table.choosing import sorting

    with ReadingProgress() as tell:
        found = read_rows(folder, tell)
    rows = best_of(chosen(found.rows, conditions), by, overall)
    shown = read_columns(names, found)
    if not (shown or as_csv or as_json):
        asked, _ = sorting(by, columns(found.rows))
        usual = usual_columns(rows)
        shown = usual if asked in usual else [*usual[:2], asked, *usual[2:]]
    print_rows(rows, found, shown, as_csv, as_json)
    if not rows and not (as_csv or as_json):
        click.echo(f"no run below {folder} has a result")
