"""An examination as tables and a paragraph on the terminal, in the words of the reports."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from symphys.api.checking import MAX_LINE_WIDTH, TABLE_SUBJECTS
from symphys.api.checking import Examined as Examined
from symphys.findings.advice import NO_SLOPE, VERDICTS, advice, answers, of_influence, slopes
from symphys.findings.levels import BAD, FAIR, GOOD, MARKS, UNKNOWN
from symphys.findings.physics import sliding

COLOURS = {GOOD: "green", FAIR: "yellow", BAD: "red", UNKNOWN: "dim"}
WORDS = {text: COLOURS[level] for words in (MARKS, VERDICTS) for level, text in words.items()} | {
    NO_SLOPE: COLOURS[FAIR]
}


def print_examined(examined: Examined) -> None:
    """Print tables, findings and advice."""
    trust, judged = examined.trust, examined.judged
    console = Console(width=None if sys.stdout.isatty() else MAX_LINE_WIDTH)
    if first := of_influence(trust, judged):
        console.print(Text("\n" + printable(first, console)))
    print_table(console, *slopes(trust))
    print_table(console, *answers(trust, judged))
    lines = [line for line in examined.findings if line.about not in TABLE_SUBJECTS]
    rows = [[line.what, line.number, MARKS[line.level], line.meaning] for line in lines]
    print_table(console, ["check", "value", "", "interpretation"], rows)
    for paragraph in (sliding(trust), advice(trust, judged)):
        if paragraph:
            console.print(Text(printable(paragraph, console) + "\n"))


def print_table(console: Console, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table; verdicts, whose column has no title, are not wrapped."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for title in header:
        table.add_column(title, no_wrap=not title, overflow="fold")
    for row in rows:
        table.add_row(*(Text(printable(cell, console), style=WORDS.get(cell, "")) for cell in row))
    console.print(table)


def printable(text: str, console: Console) -> str:
    """Replace characters that the terminal cannot show."""
    return text.encode(console.encoding, "replace").decode(console.encoding)
