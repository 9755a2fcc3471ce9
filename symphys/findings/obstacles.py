"""Obstacles to an answer: targets in conflict, costs that hold targets back, too many equations, bounds."""

from __future__ import annotations

import math

from symphys.findings.examination import Examination, HeldBound, Untouched
from symphys.findings.levels import FAIR, UNKNOWN, Finding, Judged
from symphys.findings.numerics import NO_COSTS
from symphys.findings.writing import capital, listed, several, show

TARGETS, BOUNDS = "targets", "bounds"
MAX_BOUNDS = 3
"""How many bounds are named."""
CONTRADICTING = (
    "{names} cannot {all} be met near this point: a combination of their errors does not depend on the variables and "
    "exceeds the tolerances. Change one of the targets, or add variables"
)
OPPOSED = (
    "the gradients of {names} cancel here: improving one target worsens the others equally. Change their weights or "
    "tolerances, or add variables"
)
OUTWEIGHED = (
    "the costs outweigh {names}: a [[target]] is a penalty term. Raise its `weight`, or use a [[constraint]] instead"
)
UNTOUCHED = (
    "nothing moves {body}: the closest approach is {gap} m ({contact} at t = {time} s), so the gradient of its motion "
    "is zero. Start from a motion that touches it, or search without gradients (`--solver race`)"
)
EQUATIONS = "There are more target components than unknowns. All can be met only if some of them are dependent."
HELD = (
    "The variable lies on its bound, and the objective decreases beyond it. Widen the bound if the problem allows it."
)


def obstacle_findings(trust: Examination, judged: Judged) -> list[Finding]:
    """List what stands in the way of an answer; targets only where something is missed."""
    lines = []
    if not judged.met:
        kinds = (
            (trust.contradicting, "that contradict each other", CONTRADICTING),
            (against(trust), "that oppose each other", OPPOSED),
            (trust.outweighed, "that the costs outweigh", OUTWEIGHED),
        )
        for names, which, clause in kinds:
            if names:
                what, number = f"Targets {which}", several(len(names), "target")
                lines.append(Finding(TARGETS, FAIR, what, number, capital(said_of(names, clause)) + "."))
        for each in trust.untouched:
            number = f"{show(each.gap, 2)} m ({each.contact} at t = {show(each.time)} s)"
            lines.append(
                Finding(TARGETS, FAIR, f"Nothing moves {each.body}", number, capital(untouched_words(each)) + ".")
            )
        if trust.equations > trust.unknowns:
            number = f"{show(trust.equations)} for {several(int(trust.unknowns), 'unknown')}"
            lines.append(Finding(TARGETS, UNKNOWN, "Components of targets", number, EQUATIONS))
    for bound in holding(trust, judged)[:MAX_BOUNDS]:
        lines.append(Finding(BOUNDS, FAIR, f"{capital(bound.side)} bound of {place(bound)}", extent(bound), HELD))
    return lines


def obstacles(trust: Examination, judged: Judged) -> tuple[str, ...]:
    """Return a clause for each of them: what they do and what to try. Equations are no reason by themselves."""
    clauses = []
    if not judged.met:
        if trust.contradicting:
            clauses.append(said_of(trust.contradicting, CONTRADICTING))
        if against(trust):
            clauses.append(said_of(against(trust), OPPOSED))
        if trust.outweighed:
            clauses.append(said_of(trust.outweighed, OUTWEIGHED))
        clauses += map(untouched_words, trust.untouched)
    bounds = holding(trust, judged)
    if bounds:
        named = [bound_words(bound) for bound in bounds[:MAX_BOUNDS]]
        more = [f"{len(bounds) - MAX_BOUNDS} more"] if len(bounds) > MAX_BOUNDS else []
        verb, them = ("is", "it") if len(bounds) == 1 else ("are", "them")
        clauses.append(f"{listed([*named, *more])} {verb} active: the objective would improve beyond {them}")
    return tuple(clauses)


def untouched_words(each: Untouched) -> str:
    """Write how far from a body what could move it stays."""
    return UNTOUCHED.format(body=each.body, contact=each.contact, gap=show(each.gap, 2), time=show(each.time))


def against(trust: Examination) -> tuple[str, ...]:
    """Return the targets that oppose each other, unless they are said to contradict each other anyway."""
    return () if set(trust.opposed) <= set(trust.contradicting) else trust.opposed


def holding(trust: Examination, judged: Judged) -> tuple[HeldBound, ...]:
    """Return the bounds that hold something back; none where everything is met and nothing is minimised."""
    wanted = not judged.met or not judged.checked or abs(judged.costs) > NO_COSTS
    return trust.bounds if wanted else ()


def said_of(names: tuple[str, ...], clause: str) -> str:
    """Return a clause on targets by their names."""
    return clause.format(names=listed([f'"{name}"' for name in names]), all="both" if len(names) == 2 else "all")


def bound_words(bound: HeldBound, knots: bool = True) -> str:
    """Write ``the upper bound 5 of throw[0]``; ``knots``: with the number of knots that lie there."""
    value = "" if math.isnan(bound.bound) else f" {show(bound.bound)}"
    where = f" (at {bound.knots} of {bound.of} knots)" if knots and bound.of > 1 else ""
    return f"the {bound.side} bound{value} of {place(bound)}{where}"


def place(bound: HeldBound) -> str:
    """Variable and component."""
    return f"{bound.variable}[{bound.component}]" if bound.components > 1 else bound.variable


def extent(bound: HeldBound) -> str:
    """Return the bound, and how many knots lie there."""
    knots = f"{bound.knots} of {bound.of} knots" if bound.of > 1 else ""
    return ", ".join(filter(None, ("" if math.isnan(bound.bound) else show(bound.bound), knots)))
