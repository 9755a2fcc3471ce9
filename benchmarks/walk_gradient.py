"""Whether the adjoint of a walk of a thousand steps is its derivative: against central differences, h = 1e-7.

    python benchmarks/walk_gradient.py

Gaits of ``quadruped_walk`` with legs that move by so much, in 16 samples each, along 8 random directions. Where
changes explode there are no differences to compare with, so lengths of gradients are told beside.
"""

from __future__ import annotations

import numpy as np

from symphys.problem import load_problem
from symphys.problems import find
from symphys.transcription import Transcription, transcribe
from symphys.types import Array

STEP, SAMPLES, DIRECTIONS = 1e-7, 16, 8
AMPLITUDES = (0.02, 0.05, 0.1, 0.15, 0.2)


def main() -> None:
    """A line for each gait."""
    made = transcribe(load_problem(find("quadruped_walk")), exact=True)
    for amplitude in AMPLITUDES:
        z = gait(made, amplitude)
        errors, sizes = compared(made, z)
        speed = made.judge(z).outputs["speed [m/s]"]
        print(
            f"{amplitude:g} rad, {speed:.2f} m/s: median error {np.median(errors):.1e}, nine of ten below "
            f"{np.quantile(errors, 0.9):.1e}, largest {errors.max():.1e}; gradients {np.median(sizes):.2g}, at most "
            f"{sizes.max():.2g}",
            flush=True,
        )


def gait(made: Transcription, amplitude: float) -> Array:
    """The start with sines and cosines of this size."""
    shooting = made.shooting
    blocks = shooting.by_block(shooting.start(0))
    for name in ("sines", "cosines"):
        blocks[name] = np.sign(blocks[name]) * amplitude
    return shooting.from_blocks(blocks)


def compared(made: Transcription, z: Array) -> tuple[Array, Array]:
    """(samples * directions,) relative errors of slopes, and (samples,) lengths of gradients."""
    scenario = made.shooting.scenario
    assert scenario is not None
    rng = np.random.default_rng(0)
    drawn = scenario.draw(rng, SAMPLES)
    slopes = scenario.gradient(z[None], drawn, 0.0).gradient
    assert slopes is not None
    errors = []
    for _ in range(DIRECTIONS):
        along = rng.standard_normal(z.size)
        along /= np.linalg.norm(along)
        high, low = (scenario.value((z + sign * STEP * along)[None], drawn, 0.0).merit for sign in (1, -1))
        difference, slope = (high - low) / (2 * STEP), slopes @ along
        errors.append(np.abs(slope - difference) / np.abs(difference))
    return np.concatenate(errors), np.linalg.norm(slopes, axis=1)


if __name__ == "__main__":
    main()
