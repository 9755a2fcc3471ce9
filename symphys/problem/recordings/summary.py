"""What recordings hold, in lines for people."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symphys.problem.recordings.times import steps_apart
from symphys.problem.recordings.types import Recording

WHOLE = 1e-6
"""How far the distance of samples may be off a whole number of steps."""


def recording_lines(recordings: Sequence[Recording], dt: float) -> list[str]:
    """For each [[recording]] table how many motions and samples it has, of what, how many are missing or held back.

    Args:
        recordings: of a problem.
        dt: [s] its time step.
    """
    lines = []
    for table in dict.fromkeys(each.table for each in recordings):
        lines += table_lines(table, [each for each in recordings if each.table == table], dt)
    return lines


def table_lines(table: str, own: Sequence[Recording], dt: float) -> list[str]:
    """Those of one table."""
    counts = [len(each.time) for each in own]
    held = sum(each.held_back for each in own)
    motions = "1 motion" if len(own) == 1 else f"{len(own):,} motions"
    back = f", {held:,} held back" if held else ""
    ends = f"until {max(each.time[-1] for each in own):.4g} s"
    lines = [f"{table}: {motions} of {span(counts)} samples{back}, {ends}"]
    for k, each in enumerate(own[0].measured):
        missing, total = sum(other.measured[k].missing for other in own), sum(counts)
        noise = "estimated" if each.noise is None else ", ".join(f"{value:g}" for value in dict.fromkeys(each.noise))
        lacks = f", {missing:,} of {total:,} samples missing" if missing else ""
        lines.append(f"  {each.name}: noise {noise}{lacks}")
    if own[0].start:
        lines.append(f"  starts with {', '.join(own[0].start)}")
    apart = [steps_apart(each.time, dt) for each in own]
    uneven = [steps for steps in apart if abs(steps - round(steps)) > WHOLE * max(steps, 1.0)]
    if uneven:
        steps = float(np.median(uneven))
        text = f"samples are {steps:.4g} steps of {dt:g} s apart, so that most fall between two steps"
        lines.append(f"  {text}; dt = {steps * dt / max(1, round(steps)):.6g} would fit")
    return lines


def span(counts: Sequence[int]) -> str:
    """``80 to 442``."""
    low, high = min(counts), max(counts)
    return f"{low:,}" if low == high else f"{low:,} to {high:,}"
