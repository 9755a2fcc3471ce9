"""A knee that meets its stop while the tip of its leg is just above the ground: impacts give no energy.

The stop slows the shank and throws the tip down, so the ground is met within the same step by what the stop did. No
motion may end with more energy than it began with, without gravity, motors and restitution.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import symphys
from symphys.transcription import transcribe

STOP, LINK, RADIUS, DT = 2.2, 0.5, 0.02, 0.01
MASSES = {"thigh": (16.0, 0.3), "shank": (8.0, 0.15)}

SHAPES: dict[str, Any] = {
    "thigh": {},
    "shank": {"shape": {"spheres": [{"radius": RADIUS, "centre": [0, 0, -LINK / 2]}]}},
}


def kinetic() -> str:
    """The kinetic energy [J] as a formula."""
    parts = ["20 * sumsqr(trunk.velocity)"]
    parts += [
        f"{mass / 2} * sumsqr({name}.velocity) + {inertia / 2} * sumsqr({name}.angular_velocity)"
        for name, (mass, inertia) in MASSES.items()
    ]
    return " + ".join(parts)


def leg(friction: float) -> dict[str, Any]:
    """A trunk on a vertical rail with two links below it; heights, angles and rates at the start vary."""
    hinge = {"axis": [0, 1, 0]}
    starts = ["rail.start", "hip.start", "knee.start", "rail.start_rate", "hip.start_rate", "knee.start_rate"]
    return {
        "simulation": {"duration": DT, "dt": DT},
        "world": {"gravity": [0, 0, 0]},
        "ground": {"friction": friction},
        "body": [
            {"name": "trunk", "mass": 40.0, "inertia": 1.0, "position": [0, 0, 2 * LINK]},
            *(
                {"name": name, "mass": mass, "inertia": inertia, "position": [0, 0, LINK * (1.5 - k)], **SHAPES[name]}
                for k, (name, (mass, inertia)) in enumerate(MASSES.items())
            ),
        ],
        "joint": [
            {"name": "rail", "between": ["world", "trunk"], "slider": {"axis": [0, 0, 1]}},
            {"name": "hip", "between": ["trunk", "thigh"], "hinge": hinge, "point": [0, 0, 2 * LINK]},
            {"name": "knee", "between": ["thigh", "shank"], "hinge": hinge, "point": [0, 0, LINK], "limits": [0, STOP]},
        ],
        "variable": [{"name": f"v{k}", "sets": each, "guess": 0.1} for k, each in enumerate(starts)],
        "output": [
            {"name": "before", "at": 0.0, "value": kinetic()},
            {"name": "after", "at": "end", "value": kinetic()},
        ],
    }


def draws(count: int) -> np.ndarray:
    """(count, 6): the knee reaches its stop within the step, and the tip begins 0.5 to 10 mm above the ground."""
    rng = np.random.default_rng(0)
    hip, knee = rng.uniform(-1.5, -0.5, count), STOP - rng.uniform(0.005, 0.08, count)
    tip = LINK * (2 - np.cos(hip) - np.cos(hip + knee)) - RADIUS
    height = rng.uniform(5e-4, 1e-2, count) - tip
    rates = rng.uniform([-2, -8, 9], [1, 8, 15], (count, 3))
    return np.column_stack([height, hip, knee, rates])


@pytest.mark.parametrize("friction", [0.0, 0.9])
def test_a_stop_and_the_ground_in_one_step_give_no_energy(friction: float) -> None:
    transcription = transcribe(symphys.load(leg(friction)), backend="casadi", threads=1)
    before, after = transcription.shooting.evaluator.value(draws(200), 0.0).outputs.T
    assert (after / before).max() < 1.0
