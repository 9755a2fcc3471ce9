"""An impact between two stretches of a step: no time passes, only velocities change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from symphys.collide import Contact
from symphys.motion import Motion, angular_velocity
from symphys.smooth import positive
from symphys.step.pgs import ZERO, Momenta, relax
from symphys.step.phase import Phase, expected_motions, look
from symphys.step.row import UNREACHED, ContactRow, at_touch, effective_masses, inverse_masses, make_side, moving_sides
from symphys.step.rows import width_of
from symphys.step.scene import Scene

Expr = Any
"""casadi SX, MX or DM"""

MARGIN = 1e-6
"""Of dt: the shortest stretch before or after an impact."""
TOGETHER = 1e-9
"""Of dt: impacts that are no further apart are one."""
TOUCHING = 1e-3
"""Of the distance a_ref dt^2: surfaces that near to each other take part in an impact of their bodies."""


@dataclass(frozen=True)
class Cut:
    """Where a step is cut in two.

    Attributes:
        impact: 1 if the cut is an impact, 0 if it is the middle of a step without one.
        first: length of the first stretch [s].
        fast: per pair: 1 if it closes at speed.
        struck: per pair: 1 if it meets at speed then.
    """

    impact: Expr
    first: Expr
    fast: tuple[Expr, ...]
    struck: tuple[Expr, ...]


def find_cut(scene: Scene, x: Expr) -> Cut:
    """The first impact within the step, on paths under the persistent forces of the last step."""
    dt = scene.scheme.dt
    contacts = look(scene, expected_motions(scene, x, ca.SX(dt)))
    fast = tuple(scene.keep(_closes_fast(scene, contact)) for contact in contacts)
    strikes = [ca.logic_and(closes, contact.hit) for contact, closes in zip(contacts, fast, strict=True)]
    impact, first = ca.SX(0), ca.SX(dt)
    for contact, meets in zip(contacts, strikes, strict=True):
        earliest = ca.if_else(meets, ca.fmin(first, contact.time), first)
        impact, first = scene.keep((ca.fmax(impact, meets), earliest))
    latest = first + TOGETHER * dt
    struck = tuple(
        scene.keep(ca.logic_and(meets, c.time <= latest)) for c, meets in zip(contacts, strikes, strict=True)
    )
    inside = ca.fmin(ca.fmax(first, MARGIN * dt), (1 - MARGIN) * dt)
    return Cut(impact, scene.keep(ca.if_else(impact, inside, dt / 2)), fast, struck)


def passing(scene: Scene, x: Expr, duration: Expr) -> list[Expr]:
    """Per pair: 1 if it closes at speed but does not meet within ``duration``."""
    contacts = look(scene, expected_motions(scene, x, duration))
    return [scene.keep(ca.logic_and(_closes_fast(scene, c), ca.logic_not(c.hit))) for c in contacts]


def _closes_fast(scene: Scene, contact: Contact) -> Expr:
    return ca.SX(0) if contact.pair.law.soft else contact.rate < -scene.fast


def collide_now(scene: Scene, x: Expr, cut: Cut) -> Phase:
    """The state after the impacts at ``cut``; leapfrog begins anew there, so ``lag`` is 0. Without one the same x."""
    motions = expected_motions(scene, x, ca.SX(scene.scheme.dt))
    reach = TOUCHING * scene.reference * scene.scheme.dt**2
    rows = tuple(
        scene.keep(_row(scene, contact, motions, struck, ca.logic_and(cut.impact, contact.gap < reach)))
        for contact, struck in zip(look(scene, motions), cut.struck, strict=True)
    )
    momenta = Momenta([m.velocity for m in motions], [m.momentum_k for m in motions])
    momenta, impulses, last = relax(scene, rows, momenta, [ZERO for _ in rows])
    return Phase(_with_velocities(scene, x, motions, momenta, cut.impact), rows, tuple(impulses), tuple(last))


def _row(scene: Scene, contact: Contact, motions: Sequence[Motion], struck: Expr, touching: Expr) -> ContactRow:
    """The row of a contact at the instant of an impact: of it where ``struck``, of its bodies where ``touching``."""
    moving, now = moving_sides(contact, motions), ca.SX(0)
    velocity, _, normal = at_touch(contact, moving, now)
    rebound = contact.pair.law.restitution * positive(-ca.dot(normal, velocity), scene.knob)
    frame = contact.frame(now)
    sides = tuple(make_side(i, k, m, now, frame, frame) for k, i, m in moving)
    masses = effective_masses(*inverse_masses(sides, frame.normal))
    resting = ca.if_else(touching, 0, UNREACHED)
    return ContactRow(
        contact.pair.law,
        contact,
        sides,
        frame.normal,
        frame.normal,
        **masses,
        softness=ca.SX(0),
        target=UNREACHED if contact.pair.law.soft else ca.if_else(struck, rebound, resting),
        slip_target=ca.SX.zeros(3),
        leaving=struck,
        struck=struck,
        width=struck * width_of(scene, contact),
        knob=scene.knob,
    )


def _with_velocities(scene: Scene, x: Expr, motions: Sequence[Motion], momenta: Momenta, impact: Expr) -> Expr:
    values = {name: x[scene.layout[name]] for name in scene.layout.names()}
    for motion, velocity, turning in zip(motions, momenta.velocity, momenta.angular, strict=True):
        body, name = motion.body, motion.body.name
        spin = angular_velocity(body, motion.orientation, turning)
        values |= scene.keep(
            {
                f"{name}.velocity": ca.if_else(impact, velocity, values[f"{name}.velocity"]),
                f"{name}.angular_velocity": ca.if_else(impact, spin, values[f"{name}.angular_velocity"]),
            }
        )
    values["lag"] = scene.keep(ca.if_else(impact, 0, values["lag"]))
    return scene.layout.pack(values)
