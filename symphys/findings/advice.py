"""The findings of an examination, and a paragraph of advice from them on how far a solution can be trusted.

``symphys check`` at a guess and the pages of runs use these words.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from symphys.findings.examination import Examination
from symphys.findings.levels import BAD, FAIR, GOOD, MARKS, UNKNOWN, Finding, Judged, worst_of
from symphys.findings.numerics import (
    GRADIENT,
    GRID,
    GROWTH,
    SLOPES,
    SMOOTHING,
    gradient_finding,
    growth_finding,
    reach,
    refined_finding,
    slope_finding,
    smoothed_findings,
    unfelt,
)
from symphys.findings.obstacles import obstacle_findings, obstacles
from symphys.findings.physics import (
    CONTACTS,
    ENERGY,
    balance_finding,
    contact_findings,
    gains_finding,
    jump_findings,
    miss_findings,
    stop_findings,
)
from symphys.findings.writing import capital, listed, percent, show

FAULT, NO_SLOPE = "fault", "zero"
SUBJECTS = (GRADIENT, GROWTH, GRID, SLOPES, SMOOTHING, ENERGY, CONTACTS)
VERDICTS = {GOOD: "agrees", FAIR: "agrees roughly", BAD: "disagrees", UNKNOWN: "not compared"}
"""Of a gradient with differences."""


def findings(trust: Examination, judged: Judged) -> list[Finding]:
    """List a finding for each number of an examination that is known.

    None of an accepted result is worse than fair: what is bad there is of its gradients, and refutes nothing.
    """
    lines = [Finding(FAULT, BAD, "A number that is not finite", "", f"{sentence(trust.fault)}")] if trust.fault else []
    lines += [gradient_finding(check) for check in trust.gradient]
    lines += [refined_finding(refined, judged) for refined in trust.refined]
    lines += slope_finding(trust)
    lines += miss_findings(trust)
    lines += obstacle_findings(trust, judged)
    lines += [growth_finding(trust.growth)] if trust.growth.factor.size else []
    lines += smoothed_findings(trust.smoothed, judged)
    numbers = ((trust.gained, gains_finding), (trust.momentum, balance_finding))
    lines += [find(trust) for number, find in numbers if not math.isnan(number)]
    lines += stop_findings(trust) + jump_findings(trust) + contact_findings(trust, judged)
    return [replace(line, level=FAIR) if line.level == BAD and judged.accepted else line for line in lines]


def slopes(trust: Examination) -> tuple[list[str], list[list[str]]]:
    """Header and rows of a table of gradients: against differences, and by how much refinements change them."""
    finer = [row for row in trust.refined if row.gradient]
    header = ["gradient of", "norm", "differs by", "", *(row.what for row in finer)]
    rows = []
    for check in trust.gradient:
        changes = [percent(row.gradient.get(check.variable, math.nan)) for row in finer]
        verdict = NO_SLOPE if unfelt(check) else VERDICTS[gradient_finding(check).level]
        rows.append([check.variable, show(check.scale), show(check.error, 2), verdict, *changes])
    return header, rows


def answers(trust: Examination, judged: Judged) -> tuple[list[str], list[list[str]]]:
    """Header and rows of a table of objective and worst error / tolerance by discretisation and smoothing."""
    rows = [["as asked", show(judged.objective, 4), show(judged.worst, 4), ""]]
    for row in trust.refined:
        verdict = MARKS[refined_finding(row, judged).level]
        rows.append([row.what, show(row.objective, 4), show(row.worst, 4), verdict])
    for smooth in trust.smoothed:
        rows.append([f"smoothed {show(smooth.smoothing)} m/s", show(smooth.objective, 4), show(smooth.worst, 4), ""])
    return ["simulated", "objective", "worst / tolerance", ""], rows


def advice(trust: Examination, judged: Judged) -> str:
    """Write one paragraph of what follows from the findings."""
    lines = findings(trust, judged)
    if trust.fault:
        return f"Fix this first, because no solver can continue past it: {trust.fault}."
    level = {about: worst_of(each.level for each in lines if each.about == about) for about in SUBJECTS}
    parts = (
        of_influence(trust, judged),
        of_misses(trust),
        *(sentence(clause) for clause in obstacles(trust, judged)),
        *(of_accepted(level) if judged.accepted else of_slopes(trust, level)),
        of_grid(trust, level[GRID], judged),
        of_smoothing(level[SMOOTHING]),
        of_physics(lines, level),
    )
    return " ".join(part for part in parts if part)


def of_influence(trust: Examination, judged: Judged) -> str:
    """Advise on variables that change nothing."""
    none = [check.variable for check in trust.gradient if unfelt(check)]
    if not none:
        return ""
    them = "it" if len(none) == 1 else "them"
    why = f"The gradient of {listed(none)} is zero or negligible: no target, constraint or cost depends on {them} here."
    if judged.accepted:
        return why
    return (
        f"{why} Typical causes are a body that friction holds and a throw that misses. Use another guess, smoothing, "
        "or a derivative-free solver."
    )


def of_misses(trust: Examination) -> str:
    """Advise on near misses and glancing touches."""
    line = next(iter(miss_findings(trust)), None)
    return f"A small change of the variables changes the contacts. {line.meaning}" if line else ""


def of_slopes(trust: Examination, level: Mapping[str, str]) -> tuple[str, ...]:
    """Advise on gradients, for solvers that follow them."""
    other = "The gradient changes under refinement: halve the time step if a gradient-based solver stalls."
    return (
        of_gradient(level[GRADIENT], level[GROWTH]),
        of_growth(trust, level[GROWTH], level[GRADIENT]),
        other if level[SLOPES] == BAD else "",
    )


def of_accepted(level: Mapping[str, str]) -> tuple[str, ...]:
    """Say of a result that nothing refutes whether its gradients are right, and whether it is sensitive."""
    kinks = worst_of([level[GRADIENT], level[SLOPES]]) in (FAIR, BAD)
    sensitive = level[GROWTH] in (FAIR, BAD)
    return (
        "The gradients have the errors listed below; the result does not depend on them."
        if kinks
        else of_gradient(level[GRADIENT], level[GROWTH]),
        "The final state is sensitive to earlier states." if sensitive else "",
    )


def of_gradient(level: str, growth: str) -> str:
    """Advise on the comparison of the gradient with finite differences."""
    if level == BAD and growth == BAD:
        return "Gradient and finite differences disagree, as expected for such a high sensitivity."
    return {
        GOOD: "The gradient is right: it agrees with differences.",
        FAIR: "The gradient is right up to kinks nearby; a little smoothing may help a solver that stalls.",
        BAD: "The gradient is misleading here: use a derivative-free solver, more smoothing, or another guess.",
    }.get(level, "")


def of_growth(trust: Examination, level: str, gradient: str) -> str:
    """Advise on the growth of changes; only a gradient that is right is said to reach far."""
    far = reach(trust.growth)
    if not math.isnan(far.lost):
        return f"Derivatives are not finite before t = {show(far.lost)} s: use another guess."
    if level == BAD:
        if math.isfinite(far.end):
            return (
                f"Changes double every {show(far.doubling, 2)} s, so the gradient is not to be trusted beyond "
                f"{show(far.end, 2)} s: shorten the horizon to less than that, or use a solver that needs none."
            )
        return "The end is too sensitive for any gradient: shorten the horizon, or use a solver that needs none."
    if level == GOOD and gradient not in (GOOD, FAIR):
        return ""
    return {
        GOOD: "It is reliable over the whole horizon, because perturbations hardly grow.",
        FAIR: "The final state is sensitive to earlier states, so solvers can take only small steps.",
    }.get(level, "")


def of_grid(trust: Examination, level: str, judged: Judged) -> str:
    """Advise on the result of refinement."""
    if level == GOOD:
        held = "still meets every check" if judged.met and judged.checked else "changes little"
        return f"The result {held} in a finer simulation, so it is not an artefact of the time grid."
    return {
        FAIR: "A finer simulation changes the result slightly: to build on it, solve again with half the time step.",
        BAD: f"The result does not hold in a finer simulation: {finer(trust, judged)} until it does.",
    }.get(level, "")


def finer(trust: Examination, judged: Judged) -> str:
    """Name what to refine: that by which the answer changes most."""
    bad = [row for row in trust.refined if refined_finding(row, judged).level == BAD]
    by_sweeps = bad and all(row.what == "sweeps x 2" for row in bad)
    return "add sweeps" if by_sweeps else "halve the time step"


def of_smoothing(level: str) -> str:
    """Advise on the smoothed rollout, where solvers use it."""
    if level in (FAIR, BAD):
        return "The result differs without smoothing: lower the smoothing, or solve again without it."
    return ""


def of_physics(lines: Sequence[Finding], level: Mapping[str, str]) -> str:
    """Advise on energy, momentum and the contacts."""
    parts = []
    if level[ENERGY] in (FAIR, BAD):
        worst = next(line for line in lines if line.about == ENERGY and line.level == level[ENERGY])
        parts.append(f"Look at the energy: {worst.meaning}")
    parts.append(
        {
            GOOD: "The contacts are resolved cleanly.",
            FAIR: "The contacts are resolved with small errors, listed below.",
            BAD: "The contacts are not resolved accurately enough. Fix this first.",
        }.get(level[CONTACTS], "")
    )
    return " ".join(part for part in parts if part)


def sentence(clause: str) -> str:
    """Return a clause with a capital letter and a full stop."""
    return capital(clause) + "."
