"""Whether energy and momentum are what physics allows."""

from __future__ import annotations

import math

import numpy as np

from symphys.findings.examination import Examination
from symphys.findings.levels import BAD, FAIR, GOOD, UNKNOWN, Finding, graded, worst_of
from symphys.findings.writing import listed, percent, show

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
    """Where something that lay on a surface was stopped from the side; a line for the step that took most."""
    if not trust.stops:
        return []
    worst = trust.stops[0]
    where = f"{listed(worst.contacts)} at t = {show(worst.time)} s, step {worst.step}"
    meaning = (
        f"{where}, takes {show(worst.energy, 2)} J from what "
        "lay or rolled on a surface, by a force from another side: it ran into something. Where there is only a "
        "seam or a small edge, it tripped: look at the motion there."
    )
    number = f"{show(worst.energy, 2)} J"
    return [Finding(ENERGY, FAIR, "Energy that a stop from the side takes", number, meaning)]


def jump_findings(trust: Examination) -> list[Finding]:
    """A change of place that no velocity explains, if there is one that matters."""
    level = graded(trust.jump, JUMP_LIMITS)
    if level not in (FAIR, BAD) or not trust.jump_of:
        return []
    where = f'"{trust.jump_of}" at t = {show(trust.jump_time)} s'
    meaning = (
        f"{where} moves in one step by {show(trust.jump_size, 3)}, farther than its velocities take it: something puts "
        "it there at once, as a coupling or a limit that is not kept, or bodies that begin inside each other."
    )
    doubt = f"{where} jumps by {show(trust.jump_size, 3)}, which no velocity explains"
    what = "Change of place that no velocity explains"
    return [Finding(ENERGY, level, what, show(trust.jump_size, 3), meaning, doubt * (level == BAD))]


def balance_finding(trust: Examination) -> Finding:
    """What neither forces nor contacts account for."""
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
        FAIR: "Some energy comes or goes in free motion, as of a body that tumbles or of servos that turn over: a "
        "smaller time step lessens it.",
        BAD: "Momentum or energy does not add up: that is a fault of the engine, or numbers beyond its precision.",
        UNKNOWN: "Could not be added up.",
    }[level]
    largest = worst if math.isnan(trust.drifted) else max(worst, trust.drifted)
    number = f"{show(trust.momentum, 2)} of the momentum, {show(trust.drift, 2)} J"
    total = f"{show(largest, 2)} J of energy come from nowhere"
    when = f", most in the step from t = {show(trust.drift_at)} s" * math.isfinite(trust.drift_at)
    doubt = total + when if by_energy == BAD else f"{percent(trust.momentum)} of the momentum comes from nowhere"
    return Finding(ENERGY, level, "Left unexplained in a step", number, meaning, doubt * (level == BAD))
