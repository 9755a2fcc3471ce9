"""Effective masses and the Delassus column are what impulses do to the velocity of the touching points."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from worlds.contacts import contact_of, momenta_of, numbers, terms_of

from symphys.dynamics.contact.constraint import ContactImpulse
from symphys.dynamics.contact.effective_mass import mobilities
from symphys.model.world import Law


@pytest.mark.parametrize("bodies", [1, 2])
def test_an_impulse_changes_the_slip_by_the_mobility(bodies: int) -> None:
    """u+ - u = W J for any impulse J, and W n is the Delassus column."""
    rng = np.random.default_rng(bodies)
    terms = terms_of(rng, bodies)
    contact, momenta, w = contact_of(terms, Law()), momenta_of(rng, bodies), numbers(mobilities(terms, False)[0])
    for _ in range(5):
        normal, tangent = rng.normal(), np.array([*rng.normal(size=2), 0])
        impulse = ContactImpulse(ca.SX(normal), ca.SX(tangent), ca.SX(0), ca.SX.zeros(3))
        change = numbers(contact.slip(contact.apply(momenta, impulse)) - contact.slip(momenta))
        assert change == pytest.approx(w @ [*tangent[:2], normal], abs=1e-12)
    assert numbers(contact.delassus_column) == pytest.approx(w[:, 2])


def test_normal_mass_stops_the_approach_at_once() -> None:
    rng = np.random.default_rng(0)
    contact, momenta = contact_of(terms_of(rng), Law()), momenta_of(rng)
    stop = -contact.normal_mass * contact.slip(momenta)[2]
    after = contact.apply(momenta, ContactImpulse(stop, ca.SX.zeros(3), ca.SX(0), ca.SX.zeros(3)))
    assert numbers(contact.slip(after))[2] == pytest.approx(0, abs=1e-12)


def test_tangent_mass_is_the_least_across_the_normal() -> None:
    """One number, 1 / the largest eigenvalue of the mobility across the normal."""
    for seed in range(5):
        terms = terms_of(np.random.default_rng(seed))
        across = numbers(mobilities(terms, False)[0])[:2, :2]
        largest = np.linalg.eigvalsh(across).max()
        assert numbers(contact_of(terms, Law()).tangent_mass) == pytest.approx(1 / largest)
