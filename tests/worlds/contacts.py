"""Contacts of free bodies with given masses and arms, as constraints."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from symphys.dynamics.contact.body_term import BodyTerm
from symphys.dynamics.contact.constraint import ContactConstraint
from symphys.dynamics.contact.effective_mass import (
    delassus_column,
    effective_masses,
    inverse_masses,
    symmetric_mobilities,
)
from symphys.dynamics.contact.friction import friction_at
from symphys.dynamics.unknowns import Momentum
from symphys.model.world import Law
from symphys.types import Array


def terms_of(rng: np.random.Generator, count: int = 2) -> tuple[BodyTerm, ...]:
    """Bodies of any mass, inertia and arm."""
    found = []
    for k in range(count):
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        inverse = axes @ np.diag(rng.uniform(1, 5, 3)) @ axes.T
        arm = ca.SX(0.3 * rng.normal(size=3))
        found.append(BodyTerm(1 - 2 * k, ca.SX(rng.uniform(0.5, 2)), ca.SX(inverse), arm, arm))
    return tuple(found)


def momenta_of(rng: np.random.Generator, count: int = 2) -> tuple[Momentum, ...]:
    """Of as many bodies."""
    return tuple(Momentum(ca.SX(rng.normal(size=3)), ca.SX(0.1 * rng.normal(size=3))) for _ in range(count))


def contact_of(terms: tuple[BodyTerm, ...], law: Law, **changes: Any) -> ContactConstraint:
    """A rigid contact along z."""
    normal, zero = ca.SX([0, 0, 1]), ca.SX(0)
    push, twist = symmetric_mobilities(terms, False)
    fields: dict[str, Any] = dict.fromkeys(
        ("softness", "target", "delay", "leaving", "lasts", "load", "slack", "struck", "width", "smoothing"), zero
    )
    fields |= effective_masses(*inverse_masses(terms, normal, push, twist))
    fields |= {
        "law": law,
        "friction": friction_at(law, normal, (), zero),
        "terms": terms,
        "normal": normal,
        "impulse_normal": normal,
        "same": False,
    }
    fields |= {"delassus_column": delassus_column(terms, normal, False), "separates": ca.SX(1)}
    return ContactConstraint(**(fields | {"slip_target": ca.SX.zeros(3)} | changes))


def numbers(value: Any) -> Array:
    """Of a constant expression."""
    return np.array(ca.DM(ca.SX(value))).squeeze()
