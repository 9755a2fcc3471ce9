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
        return f"Mend this first, since solvers cannot pass it: {trust.fault}."
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
    why = f"The gradient of {listed(none)} is zero or next to it: nothing that the problem asks for depends on it here"
    if judged.accepted:
        return f"{why}."
    return (
        f"{why}, as where a body is held by friction or misses what it should hit; begin elsewhere, smooth the "
        "contacts, or use a solver that needs no gradient."
    )


def of_misses(trust: Examination) -> str:
    """Advise on near misses and glancing touches."""
    line = next(iter(miss_findings(trust)), None)
    return f"Close by the motion is another one. {line.meaning}" if line else ""


def of_slopes(trust: Examination, level: Mapping[str, str]) -> tuple[str, ...]:
    """Advise on gradients, for solvers that follow them."""
    other = (
        "Simulated more finely the gradient is another one: halve the time step where a solver that follows it stalls."
    )
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
        "Gradients are right up to what is named below; what was found does not rest on them."
        if kinks
        else of_gradient(level[GRADIENT], level[GROWTH]),
        "The end is sensitive to what comes before." if sensitive else "",
    )


def of_gradient(level: str, growth: str) -> str:
    """Advise on the comparison of the gradient with finite differences."""
    if level == BAD and growth == BAD:
        return "Gradient and differences disagree, as they must where changes grow so fast."
    return {
        GOOD: "The gradient is right: it agrees with differences.",
        FAIR: "The gradient is right up to kinks nearby; a little smoothing may help a solver that stalls.",
        BAD: "Here the gradient misleads: use a solver that needs none, raise the smoothing, or begin elsewhere.",
    }.get(level, "")


def of_growth(trust: Examination, level: str, gradient: str) -> str:
    """Advise on the growth of changes; only a gradient that is right is said to reach far."""
    far = reach(trust.growth)
    if not math.isnan(far.lost):
        return f"Derivatives break off going back from the end at t = {show(far.lost)} s: begin from another guess."
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
        GOOD: "It reaches over the whole horizon, since changes hardly grow on the way.",
        FAIR: "The end is sensitive to what comes before, so small steps are to be expected.",
    }.get(level, "")


def of_grid(trust: Examination, level: str, judged: Judged) -> str:
    """Advise on the result of refinement."""
    if level == GOOD:
        held = "still meets every check" if judged.met and judged.checked else "changes little"
        return f"The result {held} when it is simulated more finely, so it is not an accident of the time grid."
    return {
        FAIR: "Simulated more finely it drifts a little: to build on the result, solve again with half the time step.",
        BAD: f"Simulated more finely it falls apart: {finer(trust, judged)} until the result holds.",
    }.get(level, "")


def finer(trust: Examination, judged: Judged) -> str:
    """Name what to refine: that by which the answer changes most."""
    bad = [row for row in trust.refined if refined_finding(row, judged).level == BAD]
    by_sweeps = bad and all(row.what == "sweeps x 2" for row in bad)
    return "add sweeps" if by_sweeps else "halve the time step"


def of_smoothing(level: str) -> str:
    """Advise on the smoothed rollout, where solvers use it."""
    if level in (FAIR, BAD):
        return "Without the smoothing that solvers see the answer is another: lower it, or solve again without."
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
            FAIR: "The contacts are resolved with small errors, named below.",
            BAD: "The contacts are not resolved well enough; mend that before anything else.",
        }.get(level[CONTACTS], "")
    )
    return " ".join(part for part in parts if part)


def sentence(clause: str) -> str:
    """Return a clause with a capital letter and a full stop."""
    return capital(clause) + "."
