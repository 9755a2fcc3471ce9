"""``symphys ls``, ``best`` and ``diff``: runs as tables of text, CSV or JSON, the best ones, and what two differ in."""

from __future__ import annotations

import shutil
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from symphys import files
from symphys.cli.arguments import REPORTS, UsageFault

if TYPE_CHECKING:
    from symphys.results.table import Rows
    from symphys.results.table.columns import Row


F = TypeVar("F", bound=Callable[..., Any])
SHOWN = ("run", "verdict", "objective", "worst", "OUTPUTS", "equivalents", "solve_seconds", "why")
"""Columns of a table on the terminal; OUTPUTS stands for outputs, if there are few."""
MAX_OUTPUTS = 3
"""Largest number of outputs that are columns."""
GAP = "  "
MAX_TEXT = 100
"""Characters of the last column where the output is no terminal."""
MIN_TEXT = 20
"""Least characters of the last column."""
MAX_FAULTS = 10
"""Largest number of printed faults."""
STYLES = {"solved": "green", "best_found": "yellow", "doubted": "red", "not_solved": "red", "unreadable": "red"}
"""Colours of verdicts on a terminal."""
QUIET_TIME, LINE_INTERVAL = 1.0, 10.0
"""[s] before progress is shown, and between lines where the output is no terminal."""


where_option = click.option(
    "--where",
    "conditions",
    multiple=True,
    metavar="CONDITION",
    help="Keep runs that satisfy a condition: objective<0.5, solver=cma, run=ball*, ground.friction>=0.3. Repeatable: "
    "all must hold.",
)


def format_options(command: F) -> F:
    """Add ``--columns A,B``, ``--csv`` and ``--json``."""
    for option in (
        click.option("--json", "as_json", is_flag=True, help="Print a JSON list with an object for each run."),
        click.option("--csv", "as_csv", is_flag=True, help="Print CSV."),
        click.option(
            "--columns",
            "names",
            metavar="A,B",
            help="Columns, separated by commas; `all` for every one. --csv and --json print all by default.",
        ),
    ):
        command = option(command)
    return command


def print_rows(rows: Sequence[Row], found: Rows, names: Sequence[str], as_csv: bool, as_json: bool) -> None:
    """Print columns of rows in the format that is asked for, and errors of reading on stderr.

    ``names``: the columns; none for the usual ones, which are all in CSV and JSON.
    """
    from symphys.results.table.columns import columns
    from symphys.results.table.writing import csv_text, json_lines

    if as_csv and as_json:
        raise UsageFault("--csv and --json: give one of them")
    if as_csv:
        click.echo(csv_text(rows, names or columns(found.rows)), nl=False)
    elif as_json:
        click.echo("\n".join(json_lines(rows, names or columns(found.rows))))
    elif rows:
        click.echo("\n".join(lines(rows, names or usual_columns(rows))))
    print_faults(found)


def read_columns(names: str | None, found: Rows) -> list[str]:
    """Return the columns that are asked for; none for the usual ones."""
    from symphys.results.table.columns import columns, find_column

    if names is None:
        return []
    known = columns(found.rows)
    return known if names.strip() == "all" else [find_column(name, known) for name in names.split(",")]


def usual_columns(rows: Sequence[Row]) -> list[str]:
    """Return the columns of SHOWN that some run has."""
    from symphys.results.table.columns import OUTPUT, columns

    outputs = [name for name in columns(rows) if name.startswith(OUTPUT)]
    few = outputs if len(outputs) <= MAX_OUTPUTS else []
    names = [each for name in SHOWN for each in (few if name == "OUTPUTS" else [name])]
    return [name for name in names if any(name in row for row in rows)]


def lines(rows: Sequence[Row], names: Sequence[str]) -> Iterator[str]:
    """Yield a header and a line for each row; numbers are rounded, and only the last column may be cut."""
    texts = [[text(row.get(name)) for row in rows] for name in names]
    rights = [any(isinstance(row.get(name), float | int) for row in rows) and name != "solved" for name in names]
    widths = [max(map(len, (name, *column))) for name, column in zip(names, texts, strict=True)]
    if names and not rights[-1]:
        widths[-1] = min(widths[-1], room(sum(widths[:-1]) + len(GAP) * (len(names) - 1)))
    yield click.style(GAP.join(map(padded, names, widths, rights)).rstrip(), bold=True)
    for cells in zip(*texts, strict=True):
        whole = GAP.join(map(styled, names, cells, map(padded, cells, widths, rights)))
        yield whole.rstrip()


def room(taken: int) -> int:
    """Return the width of the last column."""
    if not sys.stdout.isatty():
        return MAX_TEXT
    return max(shutil.get_terminal_size().columns - taken, MIN_TEXT)


def text(value: object) -> str:
    """Return the text of a cell: printable, on one line."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    words = str(value)
    return words if words.isprintable() else "".join(c if c.isprintable() else "\ufffd" for c in words)


def padded(cell: str, width: int, right: bool) -> str:
    """Pad or cut a cell to a width."""
    if len(cell) > width:
        return cell[: width - 3] + "..."
    return cell.rjust(width) if right else cell.ljust(width)


def styled(name: str, cell: str, shown: str) -> str:
    """Colour a verdict."""
    return click.style(shown, fg=STYLES[cell]) if name == "verdict" and cell in STYLES else shown


def summary(rows: Sequence[Row]) -> str:
    """Return how many runs there are, by verdict."""
    counts = Counter(row["verdict"].replace("_", " ") for row in rows)
    listed = ", ".join(f"{count:,} {word}" for word, count in counts.most_common())
    return f"{len(rows):,} run{'s' * (len(rows) != 1)}: {listed}" if rows else "no run"


def print_faults(found: Rows) -> None:
    """Print on stderr which files and folders could not be read."""
    faults = [*found.faults, *(f"{row['run']}: {row['fault']}" for row in found.rows if row.get("fault"))]
    for fault in faults[:MAX_FAULTS]:
        click.echo(f"symphys: {files.printable(text(fault))}", err=True)
    if len(faults) > MAX_FAULTS:
        click.echo(f"symphys: and {len(faults) - MAX_FAULTS} more; --columns run,fault lists them", err=True)


class ReadingProgress:
    """Progress of reading folders on stderr, after QUIET seconds; on a terminal in one line."""

    def __init__(self) -> None:
        """Start with nothing shown."""
        self.began = self.said = time.monotonic()
        self.shown = False

    def __call__(self, done: int, total: int) -> None:
        """Show that ``done`` folders are read, if a line is due."""
        if done % 50 and done < total:
            return
        now, terminal = time.monotonic(), sys.stderr.isatty()
        if now - self.began < QUIET_TIME or (now - self.said < LINE_INTERVAL and not terminal):
            return
        self.said, self.shown = now, terminal
        click.echo(f"{chr(13) * terminal}reading run folders: {done:,} of {total:,}", nl=not terminal, err=True)

    def __enter__(self) -> ReadingProgress:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Clear the line."""
        if self.shown:
            click.echo(f"\r{' ' * 60}\r", nl=False, err=True)


@click.command()
@click.argument("folder", metavar="[DIR]", type=click.Path(path_type=Path), default=REPORTS)
@where_option
@click.option("--sort", metavar="KEY", help="Sort by columns, separated by commas; -KEY sorts in descending order.")
@click.option("--limit", type=click.IntRange(1), metavar="N", help="Print at most N runs.")
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
    """List all runs below DIR (default: reports).

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


@click.command()
@click.argument("folder", metavar="[DIR]", type=click.Path(path_type=Path), default=REPORTS)
@where_option
@click.option("--overall", is_flag=True, help="Print only the best run of all cases.")
@click.option(
    "--by",
    metavar="KEY",
    default="objective",
    show_default=True,
    help="Rank runs of equal verdict by this column, the smallest first; -KEY: the largest first.",
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
    """List the best run of each case below DIR (default: reports).

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


@click.command()
@click.argument("first", metavar="RUN", type=click.Path(path_type=Path))
@click.argument("second", metavar="RUN", type=click.Path(path_type=Path))
def diff(first: Path, second: Path) -> None:
    """List the differences between two run folders.

    Settings, options, the problem's text, what was found, versions and machines. Times are left out.
    """
    from symphys.results.discovery import is_run_folder
    from symphys.results.table.difference import TEXT, differences

    for folder in (first, second):
        if not is_run_folder(folder):
            raise click.UsageError(f"{folder} is no run folder; `symphys ls DIR` lists those below a folder")
    found = differences(first, second)
    if not found:
        click.echo("no difference in configuration or results")
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
