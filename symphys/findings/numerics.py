"""Findings on the numerics: gradients against differences, refinement, growth, smoothing."""

from __future__ import annotations

import math

import numpy as np

from symphys.findings.examination import Examination, GradientCheck, Growth, Refined, Smoothed
from symphys.findings.levels import BAD, FAIR, GOOD, UNKNOWN, Finding, Judged, graded, relative_change, worst_of
from symphys.findings.writing import listed, percent, show
from symphys.records import dataclass

GRADIENT, GRID, SLOPES, GROWTH, SMOOTHING = "gradient", "grid", "slopes", "growth", "smoothing"
INFLUENCE = "influence"

NO_INFLUENCE_SHARE = 1e-8
"""A variable whose change by its scale changes no more, as a share of the value, changes nothing; what friction holds
creeps by about a hundredth of that."""
NO_INFLUENCE = (
    "No target, constraint or cost depends on this variable here, so gradient-based solvers do not change it."
)

GRADIENT_LIMITS = (1e-4, 1e-2)
"""Relative errors of a gradient: below the first it agrees, above the second it must not be used."""
JUMP_LIMITS = (1e-3, 1e-1)
"""Of jumps: a solver does not notice those below the first."""
FLAT_GRADIENT = 1e-6
"""A gradient whose norm is below this is too small to be compared."""
NO_COSTS = 1e-12
"""A sum of costs below this is none."""
OBJECTIVE_LIMITS = (0.05, 0.3)
"""Relative changes of the objective under refinement."""
WORST_LIMITS = (1.0, 3.0)
"""Error / tolerance of a solved run under refinement."""
SLOPE_LIMITS = (0.1, 0.5)
"""Relative changes of the gradient under refinement: above the second it is another direction."""
GROWTH_LIMITS = (1e2, 1e4)
"""Of a change, from one time to another. At the second 0.1 mm become 1 m: what is linear ends there."""
ORDERS = (0.3, 5.0)
"""Orders of convergence between these are shown; others are none."""


def gradient_finding(check: GradientCheck) -> Finding:
    """Return the adjoint gradient against central differences, for one variable."""
    what, number = f"Gradient of {check.variable}", show(check.error, 2)
    if unfelt(check):
        return Finding(INFLUENCE, FAIR, what, show(check.scale), NO_INFLUENCE)
    level = graded(check.error, GRADIENT_LIMITS)
    if level in (FAIR, BAD) and check.scale <= FLAT_GRADIENT:
        return Finding(
            GRADIENT, UNKNOWN, what, number, "The gradient is almost zero here, so the comparison says little."
        )
    if level == GOOD and check.jump > 0:
        small = f"as a change of {check.variable} by {show(check.jump, 2)} of its scale would"
        meaning = f"Agrees on either side, but the motion jumps here, {small}: an impact at the very end of a step."
        return Finding(GRADIENT, graded(check.jump, JUMP_LIMITS), what, number, meaning)
    meaning = {
        GOOD: "Agrees with finite differences.",
        FAIR: "Agrees roughly; a bounce or a change between slip and stick may lie within the difference's step.",
        BAD: "Does not agree: the motion has a kink here, or differences of so stiff a motion mean nothing.",
        UNKNOWN: "Could not be compared.",
    }[level]
    return Finding(GRADIENT, level, what, number, meaning)


def unfelt(check: GradientCheck) -> bool:
    """Whether nothing that is asked for depends on the variable here."""
    return check.felt <= NO_INFLUENCE_SHARE


def refined_finding(refined: Refined, judged: Judged) -> Finding:
    """Judge a finer simulation of the same z; what was met and is missed by far then is refuted."""
    what = f"Simulated again with {unbroken(refined.what) or 'a refinement'}"
    number = f"objective {show(refined.objective)}"
    if judged.checked and not math.isnan(refined.worst):
        number += f", worst error {show(refined.worst)} × tolerance"  # noqa: RUF001
    if judged.met and judged.checked:
        level = graded(refined.worst, WORST_LIMITS)
        meaning = {
            GOOD: "Every check is still met.",
            FAIR: "A tolerance is missed by a little: the solution depends on the time grid.",
            BAD: "A tolerance is missed by far: the solution is an artefact of this time grid.",
            UNKNOWN: "Could not be simulated.",
        }[level]
        doubt = {
            BAD: f"simulated with {refined.what} it misses by {show(refined.worst, 2)} × tolerance",  # noqa: RUF001
            UNKNOWN: f"it cannot be simulated with {refined.what}",
        }.get(level, "")
        return Finding(GRID, level, what, number, meaning, doubt)
    change = relative_change(judged.objective, refined.objective)
    level = graded(change, OBJECTIVE_LIMITS)
    meaning = "Could not be compared." if level == UNKNOWN else f"The objective changes by {percent(change)}."
    return Finding(GRID, level, what, number, meaning)


def slope_finding(trust: Examination) -> list[Finding]:
    """Judge how refinement changes the gradient; empty where that was not measured, or where all gradients are 0."""
    if trust.gradient and all(unfelt(check) for check in trust.gradient):
        return []
    changes = [(unbroken(refined.what), refined.change) for refined in trust.refined]
    known = [(what, change) for what, change in changes if not math.isnan(change)]
    if not known:
        return []
    level = worst_of(graded(change, SLOPE_LIMITS) for _, change in known)
    meaning = {
        GOOD: "The gradient hardly depends on the discretisation.",
        FAIR: "The gradient depends on the discretisation; a solver will notice, a smaller step helps.",
        BAD: "The gradient changes under refinement: it is an artefact of this time grid.",
    }[level]
    order = trust.order.get("gradient", math.nan)
    if ORDERS[0] <= order <= ORDERS[1]:
        meaning += f" Its error shrinks like dt to the power {show(order, 2)}."
    number = ", ".join(f"{percent(change)} with {what}" for what, change in known)
    return [Finding(SLOPES, level, "Change of the gradient", number, meaning)]


def unbroken(text: str) -> str:
    """Return the text on one line."""
    return text.replace(" ", "\N{NO-BREAK SPACE}")


@dataclass(frozen=True)
class GradientReach:
    """The reach of gradients along a growth curve.

    Attributes:
        total: the largest magnification of a change by the end.
        start: when [s] a change is magnified most.
        end: when [s] a change made then has grown beyond bounds, at the latest; inf if it never does.
        doubling: [s] in which it doubles, from then on; inf where it does not grow.
        lost: [s] before which the derivatives are not finite; nan if all are.
    """

    total: float
    start: float
    end: float
    doubling: float
    lost: float


def reach(growth: Growth) -> GradientReach:
    """Compute how far a gradient reaches.

    |dx_T/dx_s| <= |dx_T/dx_t| |dx_t/dx_s|: what the curve has fallen from s to t, a change has at least grown. So a
    gradient with respect to the state at s is not to be trusted beyond the t where the curve has fallen by the second
    of ``GROWTH_LIMITS``.
    """
    finite = np.isfinite(growth.factor)
    time, factor = growth.time[finite], growth.factor[finite]
    lost = np.nan if finite.all() or not finite.any() else float(time[0])
    if not factor.size:
        return GradientReach(np.nan, np.nan, np.inf, np.inf, np.nan)
    first = int(factor.argmax())
    grown = factor[first] / np.maximum(factor[first:], 1e-300)
    beyond, half = grown > GROWTH_LIMITS[1], grown > np.sqrt(factor[first])
    since = time[first:]
    end = float(since[beyond.argmax()]) if beyond.any() else np.inf
    doublings = np.log2(factor[first]) / 2
    doubling = float(since[half.argmax()] - since[0]) / doublings if half.any() and doublings > 0 else np.inf
    return GradientReach(float(factor[first]), float(time[first]), end, doubling, lost)


def growth_finding(growth: Growth) -> Finding:
    """Return the growth of changes along the horizon."""
    what, far = "Growth of a change until the end", reach(growth)
    if not math.isnan(far.lost):
        meaning = f"The derivatives are not finite before t = {show(far.lost)} s: nothing before can be optimised."
        return Finding(GROWTH, BAD, what, show(far.total, 2), meaning)
    level = graded(far.total, GROWTH_LIMITS)
    meaning = {
        GOOD: f"A change of 1 mm or 1 mm/s moves the end by about {show(far.total, 2)} mm at most.",
        FAIR: f"The end is sensitive: a change of 1 mm at t = {show(far.start)} s moves it by "
        f"{show(far.total / 1000, 2)} m, so a solver can take small steps only.",
        BAD: f"A change at t = {show(far.start)} s doubles every {show(far.doubling, 2)} s{too_far(far)}.",
        UNKNOWN: "Could not be measured.",
    }[level]
    doubt = f"a change at t = {show(far.start)} s is {show(far.total, 2)} times as large at the end"
    return Finding(GROWTH, level, what, f"× {show(far.total, 2)}", meaning, doubt * (level == BAD))  # noqa: RUF001


def too_far(far: GradientReach) -> str:
    """Write as a clause where a gradient ends."""
    if not math.isfinite(far.end):
        return ""
    return f"; the gradient is not to be trusted beyond {show(far.end, 2)} s"


def smoothed_findings(rows: tuple[Smoothed, ...], judged: Judged) -> list[Finding]:
    """Judge what the problem's own smoothing hides, or else how much smoothing would do no harm."""
    if not rows:
        return []
    what = f"Smoothed over {listed([show(row.smoothing) for row in rows])} m/s"
    number = f"objective {listed([show(row.objective) for row in rows])}"
    if rows[0].own:
        level = smoothed_level(rows[0], judged)
        level = BAD if level == UNKNOWN else level
        if level != GOOD and judged.accepted:
            return [
                Finding(
                    SMOOTHING, UNKNOWN, what, number, "The smoothed motion differs from the exact one, which is judged."
                )
            ]
        meaning = {
            GOOD: "The smoothed and the exact rollout agree.",
            FAIR: "The smoothed rollout differs slightly from the exact one: lower the smoothing in the last stage.",
            BAD: "The smoothed problem differs from the exact problem, which is judged: lower the smoothing.",
        }[level]
        return [Finding(SMOOTHING, level, what, number, meaning)]
    most = max((row.smoothing for row in rows if smoothed_level(row, judged) == GOOD), default=math.nan)
    if math.isnan(most):
        return [Finding(SMOOTHING, UNKNOWN, what, number, "Even the smallest of these values changes the result.")]
    return [Finding(SMOOTHING, GOOD, what, number, f"Smoothing up to {show(most)} m/s would change the result little.")]


def smoothed_level(row: Smoothed, judged: Judged) -> str:
    """Grade how much this smoothing changes the answer: what is met, what is minimised, and the motion."""
    if judged.met and judged.checked:
        answer = worst_of([graded(row.worst, WORST_LIMITS), graded(share(judged.costs, row.costs), OBJECTIVE_LIMITS)])
    else:
        answer = graded(share(judged.objective, row.objective), OBJECTIVE_LIMITS)
    return worst_of([answer, graded(row.moved, OBJECTIVE_LIMITS)])


def share(before: float, after: float) -> float:
    """Return the relative change; 0 where both are rounding, nan where one is not known."""
    return 0.0 if max(abs(before), abs(after)) < NO_COSTS else relative_change(before, after)
