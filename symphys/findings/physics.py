"""Whether the motion is one that physics allows: energy, momentum, contacts."""

from __future__ import annotations

import math

from symphys.findings.examination import Trust
from symphys.findings.levels import BAD, FAIR, GOOD, UNKNOWN, Finding, graded, worst_of
from symphys.findings.writing import listed, several, show

ENERGY, CONTACTS = "energy", "contacts"

GAIN_LIMITS = (0.0, 0.05)
"""Energy that contacts add, as a share of the largest kinetic energy."""
MOMENTUM_LIMITS = (1e-9, 1e-6)
"""Of the largest momentum: rounding, and what must not be."""
DRIFT_LIMITS = (1e-6, 1e-2)
"""Energy that nothing accounts for, in one step, as a share of the largest kinetic energy."""
RESIDUAL_LIMITS = (1e-3, 5e-2)
"""PGS residual as a share of the largest impulse."""
DEPTH_LIMITS = (0.02, 0.1)
"""Penetration as a share of the smallest radius of gyration."""


def gains_finding(trust: Trust) -> Finding:
    """Energy that contacts add."""
    peak = trust.energy.kinetic.max(initial=0.0)
    level = GOOD if trust.gained == 0 else graded(trust.gained / peak if peak > 0 else math.nan, GAIN_LIMITS)
    what, number = "Energy that contacts add", f"{show(trust.gained, 2)} J"
    if level == GOOD or not trust.gains:
        return Finding(ENERGY, level, what, number, "Contacts only took energy out of the motion.")
    worst = trust.gains[0]
    where = f"{listed(worst.contacts)} at t = {show(worst.time)} s, step {worst.step}, adds {show(worst.energy, 2)} J"
    meaning = f"{where}, which no real contact does; restitution together with friction can."
    return Finding(ENERGY, level, what, number, meaning)


def balance_finding(trust: Trust) -> Finding:
    """What neither forces nor contacts account for."""
    peak = trust.energy.kinetic.max(initial=0.0)
    share = trust.drift / peak if peak > 0 else trust.drift
    level = worst_of([graded(trust.momentum, MOMENTUM_LIMITS), graded(share, DRIFT_LIMITS)])
    if math.isnan(trust.momentum):
        level = UNKNOWN
    meaning = {
        GOOD: "Momentum adds up to rounding, and energy is only changed by forces and contacts.",
        FAIR: "Some energy comes or goes in free motion, as of a body that tumbles: a smaller time step lessens it.",
        BAD: "Momentum or energy does not add up: that is a fault of the engine, or numbers beyond its precision.",
        UNKNOWN: "Could not be added up.",
    }[level]
    number = f"{show(trust.momentum, 2)} of the momentum, {show(trust.drift, 2)} J"
    return Finding(ENERGY, level, "Left unexplained in a step", number, meaning)


def residual_finding(trust: Trust) -> Finding:
    """How far the contact solver was from its end."""
    share = trust.residual / trust.impulse if trust.impulse > 0 else math.nan
    level = GOOD if trust.residual == 0 else graded(share, RESIDUAL_LIMITS)
    meaning = {
        GOOD: "Contact impulses had settled.",
        FAIR: "Contact impulses still moved a little in the last sweep; more sweeps would settle them.",
        BAD: "Contact impulses had not settled; raise the number of sweeps.",
        UNKNOWN: "Largest change of an impulse in the last sweep.",
    }[level]
    return Finding(CONTACTS, level, "Contact solver's residual", f"{show(trust.residual, 2)} N s", meaning)


def depth_finding(trust: Trust) -> Finding:
    """How deep bodies sank into each other."""
    level = GOOD if trust.deepest <= 0 else graded(trust.deepest / trust.size, DEPTH_LIMITS)
    place = f" ({trust.depth_contact} at t = {show(trust.depth_time)} s)" if trust.depth_contact else ""
    meaning = {
        GOOD: "Nothing to be seen beside the size of the bodies.",
        FAIR: "Small beside the bodies, but visible; a smaller time step lessens it.",
        BAD: "Bodies sink into each other; use a smaller time step or more position sweeps.",
        UNKNOWN: "Largest overlap of two surfaces.",
    }[level]
    return Finding(CONTACTS, level, "Deepest penetration", f"{show(trust.deepest, 2)} m{place}", meaning)


def impacts_finding(trust: Trust) -> Finding:
    """Steps in which the exact time of impact does not hold."""
    what, number = "Several impacts of a body in one step", show(trust.multiple_impacts)
    if math.isfinite(trust.steps):
        number += f" of {several(int(trust.steps), 'step')}"
    if trust.multiple_impacts == 0:
        return Finding(CONTACTS, GOOD, what, number, "Every impact was resolved in time.")
    meaning = "Only one impact a body and step is resolved exactly; a smaller time step sets them apart."
    return Finding(CONTACTS, FAIR, what, number, meaning)


def sliding(trust: Trust) -> str:
    """A sentence on how far surfaces slid; empty where none did."""
    if not trust.slides:
        return ""
    told = [f"{slide.contact} {show(slide.distance, 2)} m (up to {show(slide.speed, 2)} m/s)" for slide in trust.slides]
    return f"Under load these surfaces slid: {listed(told)}; the slip of impacts is not counted."
