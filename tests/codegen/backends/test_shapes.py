"""Boxes, capsules and terrain: a compiled kernel gives what casadi does, values and gradients."""

from __future__ import annotations

import pytest
from tools.agreement import assert_kernel_gives_what_casadi_does
from tools.repeats import first

YARD = """
[simulation]
duration = 0.12
dt = 0.01
sweeps = 2
cuts = 0

[[body]]
name = "crate"
shape = { box = { size = [0.4, 0.3, 0.2] } }
mass = 2.0
position = [0.3, 0, 0.135]

[[body]]
name = "rod"
shape = { capsule = { radius = 0.1, length = 0.4 } }
mass = 1.0
position = [0.3, 0.05, 0.46]
orientation = { pitch_deg = 80 }

[[terrain]]
name = "hills"
height = "0.03 * sin(3 * x) * cos(2 * y)"

[[block]]
name = "slab"
shape = { box = { size = [2, 2, 0.2] } }
position = [0.3, 0, -0.1]

[[variable]]
name = "throw"
sets = "rod.velocity"
guess = [0.3, 0.2, -4]
spread = 0.2

[[target]]
name = "place"
value = "rod.position + crate.position"
tolerance = 0.1
"""


PAIRS = [("crate", "slab"), ("rod", "slab"), ("rod", "hills"), ("crate", "hills")]


@pytest.mark.slow
@pytest.mark.parametrize("smoothing", [0.0, 1e-3])
@first("meet", PAIRS)
def test_a_kernel_gives_what_casadi_does(meet: tuple[str, str], smoothing: float) -> None:
    """One of two bodies lands on the one or the other; nothing else meets."""
    others = {*PAIRS, ("crate", "rod")} - {meet}
    left_out = [f'[[pair]]\nbetween = ["{a}", "{b}"]\ncollide = false\n' for a, b in sorted(others)]
    assert_kernel_gives_what_casadi_does(YARD + "".join(left_out), smoothing)
