"""An examination as tables and a paragraph on the terminal, in the words of the reports."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from symphys import files
from symphys.findings.advice import FAULT, NO_SLOPE, VERDICTS, advice, answers, findings, of_influence, slopes
from symphys.findings.contacts import sliding
from symphys.findings.examination import Examination
from symphys.findings.levels import BAD, FAIR, GOOD, MARKS, UNKNOWN, Judged
from symphys.findings.numerics import GRADIENT, GRID, reach
from symphys.transcription import Assessment

COLOURS = {GOOD: "green", FAIR: "yellow", BAD: "red", UNKNOWN: "dim"}
WORDS = {text: COLOURS[level] for words in (MARKS, VERDICTS) for level, text in words.items()} | {
    NO_SLOPE: COLOURS[FAIR]
}
WIDTH = 110
"""Characters of a line where the output is no terminal."""
IN_TABLES = (GRADIENT, GRID)
"""Subjects of the tables above the findings."""


@dataclass(frozen=True)
class Examined:
    """An examination and the judgement that it belongs to."""

    judged: Judged
    trust: Examination

    @classmethod
    def of(cls, verdict: Assessment, trust: Mapping[str, Any]) -> Examined:
        """Combine a judgement with the numbers of ``symphys.verification.examination``."""
        goal = any(check.kind == "goal" for check in verdict.checks)
        costs = math.nan if goal else sum(verdict.costs.values())
        judged = Judged(verdict.objective, verdict.worst, verdict.solved, bool(verdict.checks), costs)
        return cls(judged, Examination.from_json(files.strict(trust)))

    @property
    def wrong(self) -> bool:
        """Whether a gradient differs from differences, or anything is not finite."""
        levels = [line.level for line in findings(self.trust, self.judged) if line.about in (GRADIENT, FAULT)]
        return FAIR in levels or BAD in levels or not math.isnan(reach(self.trust.growth).lost)


def print_examined(examined: Examined) -> None:
    """Print tables, findings and advice."""
    trust, judged = examined.trust, examined.judged
    console = Console(width=None if sys.stdout.isatty() else WIDTH)
    if first := of_influence(trust):
        console.print(Text("\n" + printable(first, console)))
    print_table(console, *slopes(trust))
    print_table(console, *answers(trust, judged))
    lines = [line for line in findings(trust, judged) if line.about not in IN_TABLES]
    rows = [[line.what, line.number, MARKS[line.level], line.meaning] for line in lines]
    print_table(console, ["looked at", "number", "", "meaning"], rows)
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
