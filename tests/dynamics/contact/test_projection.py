"""Projections of one contact converge to the law: nothing pulls, friction stays in its cone and opposes the slip."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from tools.repeats import few
from worlds.contacts import contact_of, momenta_of, numbers, terms_of

from symphys.dynamics.contact.constraint import ZERO_IMPULSE, ContactImpulse, precompute
from symphys.dynamics.contact.coupling import coupling_of
from symphys.dynamics.contact.effective_mass import mobilities
from symphys.dynamics.contact.friction import Disc
from symphys.model.world import Law

MANY = 200


@few("coupled", [False, True], 1)
@few("seed", range(6), 1)
def test_a_contact_obeys_its_law(seed: int, coupled: bool) -> None:
    """0 <= normal and u_n >= target, one of them with equality; |tangent| <= mu normal, against the slip if equal."""
    rng = np.random.default_rng(seed)
    terms, momenta, mu = terms_of(rng), momenta_of(rng), 0.4
    normal, target = ca.SX([0, 0, 1]), 0.3 * rng.normal()
    coupling = coupling_of(mobilities(terms, False)[0], normal, Disc(mu), ca.SX(0)) if coupled else None
    contact = contact_of(terms, Law(friction=mu), target=ca.SX(target), coupling=coupling)
    impulse = ZERO_IMPULSE
    for _ in range(MANY):
        momenta, impulse = contact.project(momenta, impulse)
    slip, press, tangent = numbers(contact.slip(momenta)), float(numbers(impulse.normal)), numbers(impulse.tangent)
    assert press >= 0 and slip[2] >= target - 1e-9
    assert press * (slip[2] - target) == pytest.approx(0, abs=1e-9)
    assert np.linalg.norm(tangent) <= mu * press + 1e-12
    assert np.dot(tangent, slip) == pytest.approx(-mu * press * np.linalg.norm(slip[:2]), abs=1e-8)


@pytest.mark.parametrize("smoothing", [0.0, 0.05])
@pytest.mark.parametrize("seed", range(4))
def test_what_is_known_before_the_sweeps_changes_nothing(seed: int, smoothing: float) -> None:
    rng = np.random.default_rng(seed)
    terms, momenta = terms_of(rng), momenta_of(rng)
    asked = {"target": ca.SX(5 + rng.uniform()), "slip_target": ca.SX(rng.normal(size=3))}
    widths = {"softness": ca.SX(0.1), "width": ca.SX(smoothing), "smoothing": ca.SX(smoothing)}
    contact = contact_of(terms, Law(friction=0.3), **asked, **widths)
    old = ContactImpulse(ca.SX(0.2), ca.SX([0.05, -0.02, 0.0]), ca.SX(0), ca.SX.zeros(3))
    plain, ready = (
        each.project(momenta, old)[1] for each in (contact, replace(contact, precomputed=precompute(contact)))
    )
    assert numbers(ready.normal) == pytest.approx(numbers(plain.normal), rel=1e-12)
    assert numbers(ready.tangent) == pytest.approx(numbers(plain.tangent), rel=1e-12, abs=1e-15)
    assert numbers(plain.normal) > 0 and np.abs(numbers(plain.tangent)[:2]).min() > 0


@pytest.mark.slow
def test_torques_stay_within_their_limits() -> None:
    """Torsion about the normal and rolling across it, each limited by the normal impulse."""
    rng = np.random.default_rng(1)
    momenta = momenta_of(rng)
    contact = contact_of(terms_of(rng), Law(torsion=0.02, rolling=0.01), target=ca.SX(2.0))
    impulse = ZERO_IMPULSE
    for _ in range(MANY):
        momenta, impulse = contact.project(momenta, impulse)
    press = float(numbers(impulse.normal))
    assert press > 0
    assert abs(float(numbers(impulse.spin))) <= 0.02 * press + 1e-12
    assert np.linalg.norm(numbers(impulse.roll)) <= 0.01 * press + 1e-12


def test_smoothing_ends_on_the_central_path() -> None:
    """Normal times (u_n - target) is width^2 normal_mass / 4 for a frictionless contact."""
    rng, width = np.random.default_rng(2), 0.1
    momenta = momenta_of(rng)
    contact = contact_of(terms_of(rng), Law(friction=0.0), width=ca.SX(width), smoothing=ca.SX(width))
    impulse = ZERO_IMPULSE
    for _ in range(MANY):
        momenta, impulse = contact.project(momenta, impulse)
    product = float(numbers(impulse.normal)) * numbers(contact.slip(momenta))[2]
    assert product == pytest.approx(width**2 * float(numbers(contact.normal_mass)) / 4)
