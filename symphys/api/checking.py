"""Measure how far a problem's gradient and motion can be trusted, before anything is solved."""

from __future__ import annotations

import html
import textwrap
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from symphys import files
from symphys.api.solution import Solution, read
from symphys.api.transcriptions import transcribed
from symphys.api.values import vector
from symphys.findings import advice
from symphys.findings.examination import Examination
from symphys.findings.levels import BAD, FAIR, MARKS, UNKNOWN, Finding, Judged
from symphys.findings.numerics import GRADIENT, GRID, SLOPES, reach
from symphys.findings.physics import sliding
from symphys.problem import Problem, require_solvable
from symphys.problem.problem import Source, load
from symphys.records import dataclass
from symphys.runs import check_tables
from symphys.transcription import Assessment
from symphys.verification import examine

TABLE_SUBJECTS = (GRADIENT, GRID, SLOPES)
"""Subjects of findings that the tables of the text show already."""
MAX_LINE_WIDTH = 110
"""Largest number of characters in a line."""
At = None | str | Path | Solution | Mapping[str, ArrayLike]
"""The point that is examined. None: the guess; else a solution, a run folder, or values of variables by name."""


@dataclass(frozen=True, eq=False, repr=False)
class Examined:
    """The examination of a point, and the judgement that it belongs to.

    Attributes:
        judged: the objective and the largest error / tolerance at the point that was examined.
        trust: all that was measured, such as ``trust.gradient[0].error``; see ``symphys.findings.examination``.
    """

    judged: Judged
    trust: Examination

    @classmethod
    def of(cls, verdict: Assessment, trust: Mapping[str, Any], **others: Any) -> Self:
        """Combine a judgement with the numbers of ``symphys.verification.examine``."""
        goal = any(check.kind == "goal" for check in verdict.checks)
        costs = np.nan if goal else sum(verdict.costs.values())
        judged = Judged(verdict.objective, verdict.worst, verdict.solved, bool(verdict.checks), costs)
        return cls(judged, Examination.from_json(files.strict(trust)), **others)

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """The findings, each with ``level`` ("good", "fair", "bad" or "unknown"), ``what``, ``number``, ``meaning``."""
        return tuple(advice.findings(self.trust, self.judged))

    @property
    def wrong(self) -> bool:
        """Whether a gradient differs from finite differences, or anything is not finite."""
        levels = [line.level for line in self.findings if line.about in (GRADIENT, advice.FAULT)]
        return FAIR in levels or BAD in levels or not np.isnan(reach(self.trust.growth).lost)


@dataclass(frozen=True, eq=False, repr=False)
class Checked(Examined):
    """The findings of ``check``; prints as a report in text, and shows itself in a notebook.

    Attributes:
        problem: the problem that was checked.
        judged: the objective and the largest error / tolerance at the point that was examined.
        trust: all that was measured, such as ``trust.gradient[0].error``; see ``symphys.findings.examination``.
    """

    problem: Problem

    @property
    def advice(self) -> str:
        """Advice that follows from the findings, in a paragraph."""
        return advice.advice(self.trust, self.judged)

    def __str__(self) -> str:
        """Return the report that ``symphys check`` prints: gradients, finer simulations, other findings, advice."""
        tables = (advice.slopes(self.trust), advice.answers(self.trust, self.judged))
        lines = [text_line(each) for each in self.findings if each.about not in TABLE_SUBJECTS]
        paragraphs = [textwrap.fill(text, MAX_LINE_WIDTH) for text in (sliding(self.trust), self.advice)]
        parts = [f"{self.problem.name}: {self.problem.title}", *(text_table(*each) for each in tables)]
        return "\n\n".join(filter(None, [*parts, "\n".join(lines), *paragraphs]))

    def __repr__(self) -> str:
        """Return the number of findings in a line."""
        known = [line.level for line in self.findings if line.level != UNKNOWN]
        doubtful = sum(level in (FAIR, BAD) for level in known)
        return f"<Check of {self.problem.name}: {len(known)} findings, {doubtful} not good>"

    def _repr_html_(self) -> str:
        """Return the HTML that a notebook shows."""
        from symphys.report.pages.markup import table

        head = f"<b>{html.escape(self.problem.title)}</b>"
        rows = [(each.what, each.number, MARKS[each.level], each.meaning) for each in self.findings]
        findings = (["check", "value", "", "interpretation"], rows)
        every = (advice.slopes(self.trust), advice.answers(self.trust, self.judged), findings)
        tables = [table(header, rows, "t" * len(header)) for header, rows in every]
        return "\n".join([head, *tables, f"<p>{html.escape(self.advice)}</p>"])


def check(problem: Source, at: At = None) -> Checked:
    """Validate a problem, and measure how far its gradient and its motion can be trusted.

    The examination compares the gradient with finite differences, refines the time step and the sweeps of the contact
    solver, follows the growth of perturbations, and checks energy, momentum and contacts. It takes long for long
    motions.

    Args:
        problem: any argument of ``load``.
        at: the point to examine. None: the guess; else a solution, the path of its run folder, or values of variables
            by name.

    Returns:
        The findings and their advice; ``wrong`` tells whether the gradient or the motion is faulty.

    Raises:
        ProblemError: the problem or a table of a solver cannot be used; says what would be valid.
        NotFinite: there is no such motion; names the time step and the body.
        SymphysError: ``at`` is no run folder, or does not fit the problem.

    Example:
        >>> import symphys
        >>> found = symphys.check("ball_throw")
        >>> found.wrong, [check.variable for check in found.trust.gradient]
        (False, ['throw', 'spin'])
        >>> found.trust.gradient[0].error < 1e-6
        True
    """
    read_in = load(problem)
    check_tables(read_in)
    require_solvable(read_in)
    made = transcribed(read_in, True, "casadi")
    z = vector(made.shooting, values_of(at))
    return Checked.of(made.judge(z), examine(made, z), problem=read_in)


def values_of(at: At) -> Mapping[str, ArrayLike]:
    """Return the values of variables by name; none of them for the guess."""
    if at is None or isinstance(at, Mapping):
        return at or {}
    return (at if isinstance(at, Solution) else read(at)).value


def text_line(finding: Finding) -> str:
    """Format a finding in lines of at most ``MAX_LINE_WIDTH`` characters."""
    said = f"{finding.what}: {finding.number}. {finding.meaning}" if finding.number else finding.meaning
    indent = " " * (max(map(len, MARKS.values())) + 2)
    return textwrap.fill(f"{MARKS[finding.level]:<{len(indent)}}{said}", MAX_LINE_WIDTH, subsequent_indent=indent)


def text_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Format a table with aligned columns; empty without rows."""
    if not rows:
        return ""
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    lines = [header, ["-" * width for width in widths], *rows]
    return "\n".join("  ".join(map(str.ljust, line, widths)).rstrip() for line in lines)
