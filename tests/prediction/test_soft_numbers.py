"""Frequency and damping ratio of soft contacts are identified from closed forms, at steps that are not fine.

Noise of 0.1 mm is added with one seed, so that the truth lies within the interval of the estimates and, since the step
is exact, the estimates do not depend on its length.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import symphys
from symphys.types import Array

HZ, RATIO, G = 5.0, 0.15, 9.81
OMEGA = 2 * np.pi * HZ
RATES = np.array([[0, 1], [-(OMEGA**2), -2 * RATIO * OMEGA]])
TIMES = np.arange(0.0, 1.201, 0.03)
NOISE = 1e-4


def rebounds(times: Array, height: float = 0.1937) -> Array:
    """Height [m] above a soft floor: parabolas, and the oscillator under gravity until its force is 0."""
    rest, found, began, (z, v) = np.array([-G / OMEGA**2, 0]), np.zeros_like(times), 0.0, (height, 0.0)
    while True:
        touch = began + (v + np.sqrt(v**2 + 2 * G * z)) / G
        flying = (times >= began) & (times <= touch)
        found[flying] = z + v * (times[flying] - began) - G / 2 * (times[flying] - began) ** 2
        start = np.array([0.0, v - G * (touch - began)])

        def state(t: float, start: Array = start) -> Array:
            return np.asarray(rest + expm(RATES * t) @ (start - rest))

        def force(t: float) -> float:
            return float(RATES[1] @ state(t))

        grid = np.linspace(1e-9, 1 / HZ, 200)
        falls = np.flatnonzero(np.diff(np.sign([force(t) for t in grid])) < 0)
        lasts = brentq(force, grid[falls[0]], grid[falls[0] + 1], xtol=1e-14) if falls.size else np.inf
        touching = (times > touch) & (times <= touch + lasts)
        found[touching] = [state(t)[0] for t in times[touching] - touch]
        if touch + lasts >= times[-1]:
            return found
        began, (z, v) = touch + lasts, state(lasts)


BALL = """
[simulation]
duration = 1.2
dt = {dt}
[[body]]
name = "b"
shape = {{ sphere = {{ radius = 0.1 }} }}
mass = 2
position = [0, 0, 0.2937]
[ground]
[contact]
frequency = 4.0
damping = 0.3
"""
RAIL = (
    BALL
    + """
[[joint]]
name = "rail"
between = ["world", "b"]
slider = {{ axis = [0, 0, 1] }}
point = [0, 0, 0.2937]
"""
)
"""A tree of joints, whose motion is predicted under the forces of the last step."""
RECORDED = """
[[variable]]
name = "frequency"
sets = "contact.frequency"
guess = 4.5
lower = 1
upper = 20
[[variable]]
name = "ratio"
sets = "contact.damping"
guess = 0.2
lower = 0.01
upper = 2
[identify]
loss = "squares"
[[recording]]
name = "seen"
measured = [{{ value = "b.position[2]", columns = "height", noise = {noise} }}]
[recording.table]
time = {times}
height = {heights}
"""


def estimates(folder: Path, text: str, dt: float) -> Array:
    """(2, 3): value, lower and upper end of the interval of frequency and ratio."""
    heights = rebounds(TIMES) + 0.1
    seen = heights + NOISE * np.random.default_rng(4).standard_normal(heights.size)
    numbers = {"times": TIMES.round(9).tolist(), "heights": seen.tolist(), "noise": NOISE, "dt": dt}
    path = folder / "soft.toml"
    path.write_text((text + RECORDED).format(**numbers), encoding="utf-8")
    found = symphys.identify(path)
    return np.array([[e.value, e.lower, e.upper] for e in (found["frequency"], found["ratio"])])


@pytest.mark.slow
@pytest.mark.parametrize(
    "text", [pytest.param(BALL, id="ball"), pytest.param(RAIL, id="on a rail", marks=pytest.mark.thorough)]
)
def test_frequency_and_ratio_lie_within_their_intervals_at_any_step(tmp_path: Path, text: str) -> None:
    found = [estimates(tmp_path, text, dt) for dt in (0.001, 0.003, 0.01)]
    for value, lower, upper in found[0]:
        assert 0 < upper - lower < 0.01 * value
    for each in found:
        assert each[0, 1] < HZ < each[0, 2] and each[1, 1] < RATIO < each[1, 2]
        assert each == pytest.approx(found[0], rel=1e-6)
