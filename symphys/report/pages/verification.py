"""Verification of a solution: the panel "how far to trust this" of a run's page."""

from __future__ import annotations

import math
from collections.abc import Mapping

from symphys.findings.advice import advice, answers, findings, slopes
from symphys.findings.contacts import sliding
from symphys.findings.examination import Examination
from symphys.findings.levels import MARKS, Judged
from symphys.findings.writing import show
from symphys.report.pages.markup import Drawn, Html, Part, card, figures, pill, table, tag
from symphys.results.run import Run

NOT_EXAMINED = "This run was not examined; “symphys check --at” its folder examines how far to trust it."
ONLY_MOTION = (
    "Only the motion was examined. “symphys check --at” this folder also examines its gradient, finer time steps and "
    "the growth of changes."
)
TITLE = "How far to trust this"
HOW_GROWN = (
    "By how much a small change of the state at time t is magnified until the end: distances in m, velocities in m/s, "
    "turning at the bodies' radius of gyration; estimated from a few directions. Ticks: a contact begins."
)
HOW_BALANCED = (
    "Potential energy is 0 at the origin. Angular momentum is not checked: where surfaces touched is not recorded."
)
HOW_REFINED = "The same variables, simulated otherwise: the answers, and in percent how much the gradients change."


def trusted(run: Run, pictures: Mapping[str, Drawn]) -> Html:
    """Advice, findings, figures, and the refinements as numbers."""
    judged = run.judged
    lines = findings(run.examination, judged)
    if not lines:
        unknown = tag("p", NOT_EXAMINED) if run.readable else ""
        return card(TITLE, unknown, anchor="trust")
    rows = [[pill(line.level, MARKS[line.level]), line.what, line.number, line.meaning] for line in lines]
    return card(
        TITLE,
        tag("p", advice(run.examination, judged)),
        tag("p", ONLY_MOTION) if not run.examination.gradient else "",
        table(["", "looked at", "number", "meaning"], rows, "tttt", "Verification"),
        notes(run.examination),
        drawn(pictures, "growth", HOW_GROWN),
        drawn(pictures, "energy", " ".join(filter(None, [HOW_BALANCED, sliding(run.examination)]))),
        refined(run.examination, judged),
        anchor="trust",
    )


def notes(trust: Examination) -> Html:
    """What the numbers are, where that is not in the lines."""
    if not math.isfinite(trust.step):
        return Html("")
    return tag(
        "p", f"Central differences with a step of {show(trust.step, 2)} of a variable's scale.", class_="caption"
    )


def refined(trust: Examination, judged: Judged) -> Html:
    """The refinements as tables; nothing without any."""
    if not trust.refined:
        return Html("")
    header, rows = answers(trust, judged)
    gradients, changes = slopes(trust)
    return tag(
        "details",
        tag("summary", "Refined and smoothed, as numbers"),
        table(header, rows, "tnnt", "Answers"),
        table(gradients, changes, "tnnt" + "n" * len(trust.refined), "Gradients"),
        tag("p", HOW_REFINED, class_="caption"),
    )


def drawn(pictures: Mapping[str, Drawn], name: str, caption: Part) -> Html:
    """A figure with its caption, if it was made."""
    return figures([pictures[name]] if name in pictures else [], caption)
