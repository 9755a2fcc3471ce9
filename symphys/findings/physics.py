"""Findings on the physics: whether contacts are resolved, and energy and momentum are conserved.

Contacts: settled, not too deep, no tunnelling, every impact in time, no near misses.
"""

from __future__ import annotations

import math

import numpy as np

from symphys.findings.examination import Examination, Miss
from symphys.findings.levels import BAD, FAIR, GOOD, UNKNOWN, Finding, Judged, graded, worst_of
from symphys.findings.numerics import refined_finding
from symphys.findings.writing import beside, listed, percent, several, show

CONTACTS = "contacts"

RESIDUAL_LIMITS = (1e-3, 5e-2)
"""PGS residual as a share of the largest impulse."""
LEFT_LIMITS = (1e-3, 1e-2)
"""A velocity that more sweeps would find, as a share of the largest."""
SLID = 1e-9
"""[m] below which a surface did not slide."""
SETTLING = 0.5
"""Twice the sweeps help where they leave less than this share of a residual."""
DEPTH_LIMITS = (0.02, 0.1)
"""Penetration as a share of the smallest radius of gyration."""
PASSED_LIMITS = (0.5, 1.0)
"""Penetration between two instants, as a share of a body's own: above the second its centre goes inside."""
COUNTED = (
    (
        "multiple_impacts",
        "Several impacts of a body in one step",
        "Impacts that follow one another faster come late or at once; a smaller time step or more `cuts` resolve them.",
    ),
    (
        "ambiguous_impacts",
        "Several bodies that meet at one instant",
        "Simultaneous impacts of rigid bodies have no unique outcome: the smallest gap between them changes it.",
    ),
    (
        "paradoxes",
        "Painlevé's paradox (jamming contacts)",
        "Coulomb's law has no sliding solution there, or several; the contact sticks at once.",
    ),
)
"""Kinds of steps that are counted: the number in ``Examination``, what it is, and what it means where it is not 0. A
kind that was not counted is left out, and so are all but the first where there were none."""
IN_TIME = "Every impact was resolved in time."
NONE = "No body was hit twice in a step."


def contact_findings(trust: Examination, judged: Judged) -> list[Finding]:
    """List a finding for each number on contacts that is known."""
    settled = [] if math.isnan(trust.residual) else [residual_finding(trust, judged)]
    numbers = ((trust.deepest, depth_finding), (trust.passed, passage_finding))
    return settled + [find(trust) for number, find in numbers if not math.isnan(number)] + impact_findings(trust)


def residual_finding(trust: Examination, judged: Judged) -> Finding:
    """Judge how far the contact solver was from convergence.

    Impulses that have not settled refute a result unless the same comes out where the sweeps end elsewhere. Where more
    sweeps would settle them at other velocities, it is refuted in any case: such a motion can be had, and is another.
    """
    level, number = residual_level(trust), f"{beside(trust.residual, trust.impulse, 2)} N s"
    if level == BAD and graded(trust.left, LEFT_LIMITS) != BAD and holds_elsewhere(trust, judged):
        meaning = f"The contact solver did not converge{in_steps(trust)}{more_sweeps(trust)}. {elsewhere(trust)}"
        return Finding(CONTACTS, FAIR, "Contact solver's residual", number, meaning)
    meaning = {
        GOOD: "The contact solver converged.",
        FAIR: f"Contact impulses still changed a little in the last sweep{more_sweeps(trust)}{velocity_left(trust)}.",
        BAD: f"The contact solver did not converge{in_steps(trust)}{more_sweeps(trust)}{velocity_left(trust)}.",
        UNKNOWN: "Largest change of an impulse in the last sweep.",
    }[level]
    when = f" at t = {show(trust.residual_at)} s" * math.isfinite(trust.residual_at)
    size = f"{show(trust.residual, 2)} of {show(trust.impulse, 2)} N s"
    doubt = f"the contact solver did not converge{when}: {size}{velocity_left(trust)}{refuted(trust, judged)}"
    return Finding(CONTACTS, level, "Contact solver's residual", number, meaning, doubt * (level == BAD))


def residual_level(trust: Examination) -> str:
    """Return the level of the residual as a share of the largest impulse, and of the velocity that it leaves."""
    share = trust.residual / trust.impulse if trust.impulse > 0 else math.nan
    by_impulse = GOOD if trust.residual == 0 else graded(share, RESIDUAL_LIMITS)
    return worst_of([by_impulse, graded(trust.left, LEFT_LIMITS)])


def holds_elsewhere(trust: Examination, judged: Judged) -> bool:
    """Whether other numbers of sweeps were tried, and none of them leads far from the result."""
    levels = [refined_finding(row, judged).level for row in trust.resettled]
    return bool(levels) and all(level in (GOOD, FAIR) for level in levels)


def refuted(trust: Examination, judged: Judged) -> str:
    """Return a clause on what another number of sweeps does to the result, where it is another."""
    found = [refined_finding(row, judged).doubt for row in trust.resettled]
    return next((f", and {clause}" for clause in found if clause), "")


def elsewhere(trust: Examination) -> str:
    """Return a sentence on what other numbers of sweeps lead to."""
    rows = [f"{show(row.objective)} with {row.what}" for row in trust.resettled]
    return f"The result does not depend on the number of sweeps: the objective is {listed(rows)}."


def in_steps(trust: Examination) -> str:
    """Return a clause on how many steps have impulses that have not settled, as far as they were counted."""
    if not (trust.unsettled > 0 and math.isfinite(trust.steps)):
        return ""
    return f" in {int(trust.unsettled)} of {several(int(trust.steps), 'step')}"


def velocity_left(trust: Examination) -> str:
    """Return a clause on the velocity that more sweeps would find, where it matters."""
    if graded(trust.left, LEFT_LIMITS) not in (FAIR, BAD) or not trust.left_of:
        return ""
    when = f"after the step at t = {show(trust.left_time)} s"
    return f'; "{trust.left_of}" is off by {show(trust.left_speed, 2)} m/s {when}, and more `sweeps` find its velocity'


def more_sweeps(trust: Examination) -> str:
    """Return a clause on what more sweeps would do, as far as that was measured."""
    if math.isnan(trust.residual_finer):
        return ""
    twice = f"twice the sweeps leave {show(trust.residual_finer, 2)} N s"
    if trust.residual_finer < SETTLING * trust.residual:
        return f"; {twice}: raise the number of sweeps"
    return (
        f"; {twice}, so the solver oscillates or stagnates: try a smaller time step, less friction or a smaller mass "
        "ratio"
    )


def depth_finding(trust: Examination) -> Finding:
    """Judge how deep bodies sank into each other."""
    level = GOOD if trust.deepest <= 0 else graded(trust.deepest / trust.size, DEPTH_LIMITS)
    place = f" ({trust.depth_contact} at t = {show(trust.depth_time)} s)" if trust.depth_contact else ""
    meaning = {
        GOOD: "Negligible compared with the size of the bodies.",
        FAIR: "Small compared with the bodies, but visible; a smaller time step reduces it.",
        BAD: "Bodies sink into each other; use a smaller time step or more position sweeps.",
        UNKNOWN: "Largest overlap of two surfaces.",
    }[level]
    if level == BAD and trust.depth_time == 0:
        meaning = "Surfaces overlap at the start: bound the variables so that the bodies start apart."
    doubt = f"surfaces overlap by {show(trust.deepest, 2)} m{place}"
    number = f"{beside(trust.deepest, trust.size, 2)} m{place}"
    return Finding(CONTACTS, level, "Deepest penetration of rigid surfaces", number, meaning, doubt * (level == BAD))


def passage_finding(trust: Examination) -> Finding:
    """Judge whether a body went through another between two instants."""
    what, level = "Passing through between two instants", graded(trust.passed, PASSED_LIMITS)
    where = f"{trust.passed_contact} at t = {show(trust.passed_time)} s, {show(trust.passed_depth, 2)} m deep"
    meaning = {
        GOOD: "No body went through another.",
        FAIR: f"{where}, on the straight path between two instants. A smaller time step shows if it passes through.",
        BAD: f"{where}: a body was on one side before the step and beyond after it; use a smaller time step.",
    }[level]
    doubt = f"a body goes through another: {where}"
    number = f"{show(trust.passed, 2)} of a body's size"
    return Finding(CONTACTS, level, what, number, meaning, doubt * (level == BAD))


def impact_findings(trust: Examination) -> list[Finding]:
    """Steps in which the exact time of impact does not hold, one line for each kind that was counted."""
    kinds = [(getattr(trust, name), what, meaning) for name, what, meaning in COUNTED]
    known = [kind for kind in kinds if not math.isnan(kind[0])]
    sound = not any(number > 0 for number, _, _ in known) and resolved(trust)
    of = f" of {several(int(trust.steps), 'step')}" if math.isfinite(trust.steps) else ""
    none = IN_TIME if sound else NONE
    return [
        Finding(CONTACTS, FAIR if number else GOOD, what, show(number) + of, meaning if number else none)
        for k, (number, what, meaning) in enumerate(known)
        if number or k == 0
    ]


def resolved(trust: Examination) -> bool:
    """Whether no other number speaks against it that impacts were resolved in time."""
    unsettled = residual_level(trust) == BAD
    gains = trust.gained > 0
    return not (unsettled or gains or trust.passed > PASSED_LIMITS[0] or depth_finding(trust).level == BAD)


def sliding(trust: Examination) -> str:
    """Return a sentence on how far surfaces slid; empty where none did beyond rounding."""
    slides = [
        f"{slide.contact} {show(slide.distance, 2)} m (up to {show(slide.speed, 2)} m/s)"
        for slide in trust.slides
        if slide.distance > SLID
    ]
    if not slides:
        return ""
    return f"Under load these surfaces slid: {listed(slides)}; the slip of impacts is not counted."


NEARBY = "nearby"

STEP = 1e-3
"""Of the variables' scales: what solvers step in any case."""
SPREAD = 1.0
"""Of their spreads: where seeds begin."""


def miss_findings(trust: Examination) -> list[Finding]:
    """Return a line for each that lies within a small step or within the spread of seeds."""
    return [miss_finding(miss) for miss in trust.misses if miss.steps <= STEP or miss.spreads <= SPREAD]


def miss_finding(miss: Miss) -> Finding:
    """Describe one near miss, or one glancing touch."""
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


ENERGY = "energy"

AT_REST = 1e-6
"""Of the potential energy: kinetic energy below that is of what hardly moves, and no measure of anything."""
GAIN_LIMITS = (0.0, 0.05)
"""Energy that contacts add, as a share of the largest kinetic energy."""
MOMENTUM_LIMITS = (1e-9, 1e-6)
"""Of the largest momentum: rounding, and what must not be."""
DRIFT_LIMITS = (1e-6, 1e-2)
"""Energy that nothing accounts for, in one step, as a share of the largest kinetic energy."""
DRIFTED_LIMITS = (1e-3, 5e-2)
"""The same, added up over the motion."""

JUMP_LIMITS = (2e-2, 0.1)
"""Change of place that is noticeable, and that is too large, as a share of a body's size or of a radian."""


def largest_energy(trust: Examination) -> float:
    """[J] that energies are compared with: the largest kinetic one, or a share of the other where nothing moves."""
    potential = float(np.abs(trust.energy.potential).max(initial=0.0))
    return max(float(trust.energy.kinetic.max(initial=0.0)), AT_REST * potential)


def gains_finding(trust: Examination) -> Finding:
    """Energy that contacts add."""
    peak = largest_energy(trust)
    level = GOOD if trust.gained == 0 else graded(trust.gained / peak if peak > 0 else math.nan, GAIN_LIMITS)
    what, number = "Energy that contacts add", f"{show(trust.gained, 2)} J"
    if level == GOOD or not trust.gains:
        return Finding(ENERGY, level, what, number, "Contacts only took energy out of the motion.")
    worst = trust.gains[0]
    where = f"{listed(worst.contacts)} at t = {show(worst.time)} s, step {worst.step}, adds {show(worst.energy, 2)} J"
    meaning = f"{where}, which no real contact does; restitution together with friction can."
    doubt = f"contacts add {show(trust.gained, 2)} J, most of it {listed(worst.contacts)} at t = {show(worst.time)} s"
    return Finding(ENERGY, level, what, number, meaning, doubt * (level == BAD))


def stop_findings(trust: Examination) -> list[Finding]:
    """Describe the step in which a stop from the side took most energy from something that lay on a surface."""
    if not trust.stops:
        return []
    worst = trust.stops[0]
    where = f"{listed(worst.contacts)} at t = {show(worst.time)} s, step {worst.step}"
    meaning = (
        f"{where}, takes {show(worst.energy, 2)} J from a body that lay or rolled on a surface: it hit an obstacle, or "
        "tripped over a seam or a small edge. Look at the motion there."
    )
    number = f"{show(worst.energy, 2)} J"
    return [Finding(ENERGY, FAIR, "Energy lost in a lateral impact", number, meaning)]


def jump_findings(trust: Examination) -> list[Finding]:
    """Return a change of place that no velocity explains, if there is one that matters."""
    level = graded(trust.jump, JUMP_LIMITS)
    if level not in (FAIR, BAD) or not trust.jump_of:
        return []
    where = f'"{trust.jump_of}" at t = {show(trust.jump_time)} s'
    meaning = (
        f"{where} jumps by {show(trust.jump_size, 3)} in one step, farther than its velocity explains. Check for "
        "couplings and limits that are violated, and for bodies that overlap at the start."
    )
    doubt = f"{where} jumps by {show(trust.jump_size, 3)}, which no velocity explains"
    what = "Unexplained displacement"
    return [Finding(ENERGY, level, what, show(trust.jump_size, 3), meaning, doubt * (level == BAD))]


def balance_finding(trust: Examination) -> Finding:
    """Judge the energy and momentum that neither forces nor contacts account for."""
    peak = largest_energy(trust)
    worst = trust.drift if math.isnan(trust.unexplained) else trust.unexplained
    shares = [energy / peak if peak > 0 else energy for energy in (worst, trust.drifted)]
    by_energy = worst_of(map(graded, shares, (DRIFT_LIMITS, DRIFTED_LIMITS)))
    if by_energy == GOOD and trust.drift > DRIFT_LIMITS[0] * peak:
        by_energy = FAIR
    level = worst_of([graded(trust.momentum, MOMENTUM_LIMITS), by_energy])
    if math.isnan(trust.momentum):
        level = UNKNOWN
    meaning = {
        GOOD: "Momentum adds up to rounding, and energy is only changed by forces and contacts.",
        FAIR: "Energy drifts in free motion, by free rotation or switching servos. A smaller time step reduces it.",
        BAD: "Momentum or energy is not balanced: this is an engine fault or a loss of precision.",
        UNKNOWN: "The balance could not be computed.",
    }[level]
    largest = worst if math.isnan(trust.drifted) else max(worst, trust.drifted)
    number = f"{show(trust.momentum, 2)} of the momentum, {show(trust.drift, 2)} J"
    total = f"{show(largest, 2)} J of energy are unaccounted for"
    when = f", most in the step from t = {show(trust.drift_at)} s" * math.isfinite(trust.drift_at)
    doubt = total + when if by_energy == BAD else f"{percent(trust.momentum)} of the momentum is unaccounted for"
    return Finding(ENERGY, level, "Left unexplained in a step", number, meaning, doubt * (level == BAD))
