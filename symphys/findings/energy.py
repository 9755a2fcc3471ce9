"""Whether energy and momentum are what physics allows."""

from __future__ import annotations

import math

import numpy as np

from symphys.findings.examination import Examination
from symphys.findings.levels import BAD, FAIR, GOOD, UNKNOWN, Finding, graded, worst_of
from symphys.findings.writing import listed, percent, show

ENERGY, JOINTS = "energy", "joints"

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


JUMP_LIMITS = (0.2, 1.0)
"""Of a joint that jumps, as a share of the most that it moves in a step."""


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


def jump_findings(trust: Examination) -> list[Finding]:
    """A joint that jumps, if one does."""
    level = graded(trust.jump, JUMP_LIMITS)
    if level in (GOOD, UNKNOWN):
        return []
    moved = f"{trust.jump_joint} moves by {show(abs(trust.jump_moved), 2)} {trust.jump_unit}"
    where = f"{moved} in the step from t = {show(trust.jump_time)} s, which its rate does not account for"
    meaning = f"The joint {where}: a coupling, a limit or a loop put it there, as where one does not hold at the start."
    number = f"{percent(trust.jump)} of a step"
    return [Finding(JOINTS, level, "Joint that jumps", number, meaning, where * (level == BAD))]
