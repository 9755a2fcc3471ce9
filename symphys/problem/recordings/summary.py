"""A summary of recordings, in lines for people."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symphys.problem.model import ProblemData
from symphys.problem.recordings.conversion import steps_apart
from symphys.problem.recordings.types import Recording
from symphys.problem.start import MAX_OVERLAP, StartValues

STEP_TOLERANCE = 1e-6
"""How far the distance of samples may be off a whole number of steps."""


def recording_lines(problem: ProblemData) -> list[str]:
    """Summarize each [[recording]] table: motions, samples, columns, missing and held-back samples.

    Also where surfaces overlap at a start that a recording sets, and whether samples lie between time steps.
    """
    lines = []
    for table in dict.fromkeys(each.table for each in problem.recordings):
        lines += table_lines(problem, table, [each for each in problem.recordings if each.table == table])
    return lines


def table_lines(problem: ProblemData, table: str, own: Sequence[Recording]) -> list[str]:
    """Summarize one table."""
    dt = problem.simulation.dt
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
    for name, driven in own[0].inputs.items():
        missing, total = sum(other.inputs[name].missing for other in own), sum(counts)
        lacks = f", {missing:,} of {total:,} rows without it" if missing else ""
        between = "held" if driven.interpolation == "constant" else "linear"
        lines.append(f"  driven by {name}, {between} between samples{lacks}")
    if own[0].start:
        lines.append(f"  starts with {', '.join(name for name in own[0].start if name in problem.initial)}")
        depth, which = deepest_start(problem, own)
        if depth > MAX_OVERLAP:
            text = f"surfaces overlap by {depth:.3g} m at the start of {which.name}, more than elsewhere"
            lines.append(f"  {text}; are frame and units right?")
    apart = [steps_apart(each.time, dt) for each in own]
    uneven = [steps for steps in apart if abs(steps - round(steps)) > STEP_TOLERANCE * max(steps, 1.0)]
    if uneven:
        steps = float(np.median(uneven))
        text = f"samples are {steps:.4g} steps of {dt:g} s apart, so that most fall between two steps"
        lines.append(f"  {text}; dt = {steps * dt / max(1, round(steps)):.6g} would fit")
    return lines


def deepest_start(problem: ProblemData, own: Sequence[Recording]) -> tuple[float, Recording]:
    """Return the deepest overlap [m] at the starts of recordings and its recording; negative without overlap."""
    starts, found = StartValues(), list[tuple[float, Recording]]()
    for each in own:
        state = starts.of(problem.parametric, {**problem.initial, **problem.parameters, **each.start})
        found.append((-float(state.gaps().min(initial=np.inf)), each))
    return max(found, key=lambda pair: pair[0])


def span(counts: Sequence[int]) -> str:
    """``80 to 442``."""
    low, high = min(counts), max(counts)
    return f"{low:,}" if low == high else f"{low:,} to {high:,}"
