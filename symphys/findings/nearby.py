"""Touches that a small change would make or lose: there the motion jumps, and no gradient tells."""

from __future__ import annotations

from symphys.findings.examination import Examination, Miss
from symphys.findings.levels import FAIR, Finding
from symphys.findings.writing import show

NEARBY = "nearby"

STEP = 1e-3
"""Of the variables' scales: what solvers step in any case."""
SPREAD = 1.0
"""Of their spreads: where seeds begin."""


def miss_findings(trust: Examination) -> list[Finding]:
    """A line for each that lies within a small step or within the spread of seeds."""
    return [miss_finding(miss) for miss in trust.misses if miss.steps <= STEP or miss.spreads <= SPREAD]


def miss_finding(miss: Miss) -> Finding:
    """One near miss, or one glancing touch."""
    number = f"{show(miss.gap, 2)} m ({miss.contact} at t = {show(miss.time)} s)"
    by = f"a change of {miss.variable} by {show(miss.change, 2)}"
    if miss.touches:
        meaning = f"{miss.contact} touches at t = {show(miss.time)} s by {show(miss.gap, 2)} m only: {by} misses it"
        what = "Glancing touch"
    else:
        meaning = f"{miss.contact} clears by {show(miss.gap, 2)} m at t = {show(miss.time)} s: {by} makes it touch"
        what = "Near miss"
    where = "within the spread of seeds" if miss.spreads <= SPREAD else "a small step for a solver"
    return Finding(NEARBY, FAIR, what, number, f"{meaning}, which is {where}; beyond that the objective jumps.")
