"""How far a solution can be trusted: levels and plain words from the recorded numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

from symphys.report.records import GradientCheck, Refined, Run, Trust
from symphys.report.words import several, show

GOOD, FAIR, BAD, UNKNOWN = "good", "fair", "bad", "unknown"

GRADIENT_LIMITS = (1e-4, 1e-2)
"""Relative errors of a gradient: below the first it agrees, above the second it must not be used."""
FLAT = 1e-6
"""A gradient whose norm is below this is too small to be compared."""
OBJECTIVE_LIMITS = (0.05, 0.3)
"""Relative changes of the objective under refinement."""
WORST_LIMITS = (1.0, 3.0)
"""Error / tolerance of a solved run under refinement."""
RESIDUAL_LIMITS = (1e-3, 5e-2)
"""PGS residual as a share of the largest impulse."""
DEPTH_LIMITS = (0.01, 0.05)
"""Penetration as a share of the smallest radius."""


@dataclass(frozen=True)
class Sizes:
    """What absolute numbers are compared with; nan where the recordings are missing.

    Attributes:
        impulse: the largest impulse of any contact in a step [N s].
        radius: of the smallest sphere [m].
        steps: how many steps the motion has.
    """

    impulse: float = math.nan
    radius: float = math.nan
    steps: float = math.nan


@dataclass(frozen=True)
class Finding:
    """One line of the panel: a level, what was looked at, its number, and what that means."""

    level: str
    what: str
    number: str
    meaning: str


def graded(value: float, limits: tuple[float, float]) -> str:
    """The level of a number that had better be small."""
    if math.isnan(value):
        return UNKNOWN
    return GOOD if value <= limits[0] else FAIR if value <= limits[1] else BAD


def gradient_finding(check: GradientCheck) -> Finding:
    """The adjoint gradient against central differences, for one variable."""
    what, number = f"Gradient of {check.variable}", show(check.error, 2)
    level = graded(check.error, GRADIENT_LIMITS)
    if level in (FAIR, BAD) and check.scale <= FLAT:
        return Finding(UNKNOWN, what, number, "The gradient is almost zero here, so the comparison says little.")
    meaning = {
        GOOD: "Agrees with finite differences.",
        FAIR: "Agrees roughly; a bounce or a change between slip and stick may lie within the difference's step.",
        BAD: "Does not agree: the motion has a kink here, or differences of so stiff a motion mean nothing.",
        UNKNOWN: "Could not be compared.",
    }[level]
    return Finding(level, what, number, meaning)


def refined_finding(refined: Refined, run: Run) -> Finding:
    """The same z, simulated more finely."""
    finer = (refined.what or "a refinement").replace(" ", "\N{NO-BREAK SPACE}")
    what = f"Simulated again with {finer}"
    change = relative_change(run.objective, refined.objective)
    number = f"objective {show(refined.objective)}"
    if run.checks and not math.isnan(refined.worst):
        number += f", worst error {show(refined.worst)} × tolerance"  # noqa: RUF001
    if run.solved and run.checks:
        level = graded(refined.worst, WORST_LIMITS)
        meaning = {
            GOOD: "Every check is still met.",
            FAIR: "Misses a tolerance by a little: the solution depends on the time grid.",
            BAD: "Misses by far: the solution belongs to this time grid, not to the physics.",
            UNKNOWN: "Could not be simulated.",
        }[level]
        return Finding(level, what, number, meaning)
    level = graded(change, OBJECTIVE_LIMITS)
    meaning = "Could not be compared." if level == UNKNOWN else f"The objective changes by {show(100 * change, 2)} %."
    return Finding(level, what, number, meaning)


def relative_change(before: float, after: float) -> float:
    """|after - before| / |before|; nan if one is not finite."""
    if not (math.isfinite(before) and math.isfinite(after)):
        return math.nan
    return abs(after - before) / max(abs(before), 1e-12)


def residual_finding(trust: Trust, sizes: Sizes) -> Finding:
    """How far the contact solver was from its end."""
    share = trust.residual / sizes.impulse if sizes.impulse > 0 else math.nan
    level = GOOD if trust.residual == 0 else graded(share, RESIDUAL_LIMITS)
    meaning = {
        GOOD: "Contact impulses had settled.",
        FAIR: "Contact impulses still moved a little in the last sweep; more sweeps would settle them.",
        BAD: "Contact impulses had not settled; raise the number of sweeps.",
        UNKNOWN: "Largest change of an impulse in the last sweep.",
    }[level]
    return Finding(level, "Contact solver's residual", f"{show(trust.residual, 2)} N s", meaning)


def depth_finding(trust: Trust, sizes: Sizes) -> Finding:
    """How deep bodies sank into each other."""
    level = GOOD if trust.deepest <= 0 else graded(trust.deepest / sizes.radius, DEPTH_LIMITS)
    meaning = {
        GOOD: "Nothing to be seen beside the size of the bodies.",
        FAIR: "Small beside the bodies, but visible; a smaller time step lessens it.",
        BAD: "Bodies sink into each other; use a smaller time step or more position sweeps.",
        UNKNOWN: "Largest overlap of two surfaces.",
    }[level]
    return Finding(level, "Deepest penetration", f"{show(trust.deepest, 2)} m", meaning)


def impacts_finding(trust: Trust, sizes: Sizes) -> Finding:
    """Steps in which the exact time of impact does not hold."""
    number = show(trust.multiple_impacts)
    if math.isfinite(sizes.steps):
        number += f" of {several(int(sizes.steps), 'step')}"
    if trust.multiple_impacts == 0:
        return Finding(GOOD, "Several impacts of a body in one step", number, "Every impact was resolved in time.")
    meaning = "Only one impact a body and step is resolved exactly; a smaller time step sets them apart."
    return Finding(FAIR, "Several impacts of a body in one step", number, meaning)


def findings(run: Run, sizes: Sizes) -> list[Finding]:
    """Every line of the panel for which there is a number."""
    trust = run.trust
    lines = [gradient_finding(check) for check in trust.gradient]
    lines += [refined_finding(refined, run) for refined in trust.refined]
    if not math.isnan(trust.residual):
        lines.append(residual_finding(trust, sizes))
    if not math.isnan(trust.deepest):
        lines.append(depth_finding(trust, sizes))
    if not math.isnan(trust.multiple_impacts):
        lines.append(impacts_finding(trust, sizes))
    return lines


def advice(run: Run, lines: list[Finding]) -> str:
    """One short paragraph: what the lines say together."""
    gradient = worst_of([line for line in lines if line.what.startswith("Gradient")])
    grid = worst_of([line for line in lines if line.what.startswith("Simulated")])
    rest = worst_of([line for line in lines if not line.what.startswith(("Gradient", "Simulated"))])
    return " ".join(part for part in (of_gradient(gradient), of_grid(grid, run.solved), of_rest(rest)) if part)


def worst_of(lines: list[Finding]) -> str:
    """The worst level; unknown without any."""
    order = (UNKNOWN, GOOD, FAIR, BAD)
    return max((line.level for line in lines), key=order.index, default=UNKNOWN)


def of_gradient(level: str) -> str:
    """What the comparison with finite differences advises."""
    return {
        GOOD: "The gradients are right, so a solver that uses them was led well.",
        FAIR: "The gradients are right up to kinks nearby; a little smoothing may help a solver that stalls.",
        BAD: "Near this solution gradients mislead: compare with a solver that needs none, or raise the smoothing.",
    }.get(level, "")


def of_grid(level: str, solved: bool) -> str:
    """What refinement advises."""
    if level == GOOD:
        held = "still meets every target" if solved else "changes little"
        return f"The result {held} when it is simulated more finely, so it is not an accident of the time grid."
    return {
        FAIR: "Simulated more finely it drifts a little: to build on the result, solve again with half the time step.",
        BAD: "Simulated more finely it falls apart: halve the time step or add sweeps until the result holds.",
    }.get(level, "")


def of_rest(level: str) -> str:
    """What the state of the contacts advises."""
    return {
        GOOD: "The contacts are resolved cleanly.",
        FAIR: "The contacts are resolved with small errors, named above.",
        BAD: "The contacts are not resolved well enough; mend that before anything else.",
    }.get(level, "")
