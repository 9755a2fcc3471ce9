"""What became of the parts of a model: taken over, approximated, left out, or recovered from its file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

Kind = Literal["taken", "approximated", "left out", "recovered"]


@dataclass(frozen=True)
class ImportFinding:
    """What became of one part of a model, or of several alike.

    Attributes:
        kind: what was done with it.
        what: the part, as the file calls it.
        how: what was done instead, or why it was left out; one sentence.
        amount: how far off, with its unit; empty where that has no sense.
    """

    kind: Kind
    what: str
    how: str
    amount: str = ""


Finding = ImportFinding
"""Its name within this room; an examination has findings of its own."""


def gathered(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Findings without repetition: those that say the same of several parts are one, with all their names."""
    found: dict[tuple[str, str, str, str], list[Finding]] = {}
    for finding in findings:
        head = finding.what.rpartition(" ")[0]
        found.setdefault((finding.kind, head, finding.how, finding.amount), []).append(finding)
    return tuple(joined(head, several) for (_, head, _, _), several in found.items())


def joined(head: str, several: Sequence[Finding]) -> Finding:
    """``joint a`` and ``joint b`` as ``joint a, b``."""
    names = list(dict.fromkeys(finding.what.rpartition(" ")[2] for finding in several))
    if len(names) == 1 or not head:
        return several[0]
    return replace(several[0], what=f"{head} {', '.join(names)}")
