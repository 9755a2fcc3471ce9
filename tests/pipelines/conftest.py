"""Problems that something outside can act on."""

from __future__ import annotations

import pytest
from worlds.driven import TABLES

import symphys


@pytest.fixture(scope="session")
def problem() -> symphys.Problem:
    return symphys.load(TABLES)


@pytest.fixture(scope="session")
def ending() -> symphys.Problem:
    """The same, over where the cart has gone 5 cm, with the time that is left as a cost."""
    return symphys.load({**TABLES, "termination": {"margin": "0.05 - rail.position", "cost": 2}})


@pytest.fixture(scope="session")
def sampled() -> symphys.Problem:
    """The same with masses and pushes that differ."""
    scenario = [
        {"name": "mass", "sets": "cart.mass", "factor": 0.5},
        {"name": "push", "sets": "cart.force[1]", "shift": 3, "lasts": 0.1},
    ]
    return symphys.load({**TABLES, "scenario": scenario})


@pytest.fixture(scope="session")
def step(problem: symphys.Problem) -> symphys.CompiledStep:
    return symphys.compile_step(problem)
