"""Which impacts the last stretch of a step leaves to the next step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys.collide import Contact
from symphys.step.impact import Cut, strikes
from symphys.step.paths import bodies_of, expected_motions, look
from symphys.step.restitution import eccentric_bodies
from symphys.step.scene import Scene, Setting, State
from symphys.world import Law

Expr = Any
"""casadi SX, MX or DM"""


def deferred(scene: Scene, x: State, duration: Expr, cuts: Sequence[Cut]) -> list[Expr]:
    """Per pair: 1 if it must give no impulse within ``duration`` [s], the last stretch of a step.

    That is what closes at speed but does not meet. And of a body that can be hit off its centre all but its first
    impact in the step: two at once would be resolved from the velocities before both, which can add energy.
    """
    do, pairs = scene.pieces.do, scene.world.pairs
    contacts = look(scene, expected_motions(scene, x, duration), duration)
    hits = [do(_hit, scene.setting, pair.law, contact) for pair, contact in zip(pairs, contacts, strict=True)]
    first = dict.fromkeys(eccentric_bodies(scene.world), duration)
    for pair, contact, (_, meets) in zip(pairs, contacts, hits, strict=True):
        for body in first.keys() & set(bodies_of(pair)):
            first[body] = do(_sooner, first[body], meets, contact.time)
    found = []
    for pair, contact, (fast, meets) in zip(pairs, contacts, hits, strict=True):
        waits = do(_passes, fast, meets)
        for body in sorted(first.keys() & set(bodies_of(pair))):
            struck = tuple(cut.struck[j] for cut in cuts for j, other in enumerate(pairs) if body in bodies_of(other))
            waits = do(_later, waits, fast, contact.time, first[body], struck)
        found.append(waits)
    return found


def _hit(setting: Setting, law: Law, contact: Contact) -> tuple[Expr, Expr]:
    """(whether it closes at speed, whether it then meets)."""
    fast = strikes(setting, law, contact)
    return fast, ca.logic_and(fast, contact.hit)


def _sooner(first: Expr, meets: Expr, time: Expr) -> Expr:
    return ca.if_else(meets, ca.fmin(first, time), first)


def _passes(fast: Expr, meets: Expr) -> Expr:
    return ca.logic_and(fast, ca.logic_not(meets))


def _later(waits: Expr, fast: Expr, time: Expr, first: Expr, struck: tuple[Expr, ...]) -> Expr:
    before = ca.mmax(ca.vertcat(*struck)) if struck else ca.SX(0)
    return ca.fmax(waits, ca.logic_and(fast, ca.logic_or(time > first, before)))
