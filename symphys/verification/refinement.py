"""The answer and its gradient under finer time steps and more sweeps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from symphys.shooting import VariableBlock
from symphys.trajectory import NotFinite
from symphys.transcription import Transcription, transcribe

Array = NDArray[np.float64]

FINER_DT, FINEST_DT, MORE_SWEEPS, ONE_MORE = "dt / 2", "dt / 4", "sweeps x 2", "sweeps + 1"
TOLD = {what: f"simulating with {what}" for what in (FINER_DT, FINEST_DT, MORE_SWEEPS)}
"""What announces each refinement, in their order."""
SETTLED = 1e-3
"""Residuals below this share of the largest impulse are not looked into."""
UNSETTLED = 5e-2
"""Residuals above this share of the largest impulse say that impulses have not settled."""
ROUNDING = 1e-9
"""Relative changes below this say nothing about the order of convergence."""


def refine(transcription: Transcription, z: Array, tell: Callable[[str], None] = lambda what: None) -> dict[str, Any]:
    """How ``z`` does in finer discretisations; ``tell`` is called with the words of each before it is simulated.

    Returns:
        "refined": for dt / 2, dt / 4 and twice the sweeps the "objective", the "worst" error / tolerance, and
        "gradient": per variable the change of the probe's gradient relative to its norm, in the variables' scales;
        None where it is flat.
        "order": of convergence in dt, of the "objective" and of the "gradient"; None where it cannot be seen.
    """
    slopes = [transcription.probe.gradient(z)]
    objectives = [transcription.judge(z).objective]
    rows = []
    for what in TOLD:
        tell(TOLD[what])
        finer = finer_problem(transcription, what)
        verdict, slope = finer.judge(z), finer.probe.gradient(z)
        changes = {block.name: change(block, slopes[0], slope) for block in transcription.shooting.blocks}
        rows.append({"what": what, "objective": verdict.objective, "worst": verdict.worst, "gradient": changes})
        objectives.append(verdict.objective)
        slopes.append(slope)
    return {"refined": rows, "order": {"objective": order(objectives[:3]), "gradient": order(slopes[:3])}}


def settling(transcription: Transcription, z: Array, residual: float, impulse: float) -> dict[str, float]:
    """Whether more sweeps would settle the contacts: "residual_finer" [N s], what twice the sweeps leave.

    Nothing where the ``residual`` is small beside the largest ``impulse`` of a contact in a step [N s].
    """
    if not residual > SETTLED * impulse:
        return {}
    finer = finer_problem(transcription, MORE_SWEEPS)
    try:
        return {"residual_finer": float(finer.record(z).motion.residual.max(initial=0.0))}
    except NotFinite:
        return {"residual_finer": float("inf")}


def resettled(transcription: Transcription, z: Array, residual: float, impulse: float) -> dict[str, Any]:
    """What becomes of ``z`` where impulses have not settled, if the sweeps end elsewhere.

    Projections that go round in a cycle mostly do so in two turns, so that one sweep more ends in the other turn, and
    twice as many show the cycle further on.

    Returns:
        "resettled": for one sweep more and for twice the sweeps the "objective" and the "worst" error / tolerance.
        Nothing where impulses have settled.
    """
    if not residual > UNSETTLED * impulse > 0:
        return {}
    rows = []
    for what in (ONE_MORE, MORE_SWEEPS):
        verdict = finer_problem(transcription, what).judge(z)
        rows.append({"what": what, "objective": verdict.objective, "worst": verdict.worst})
    return {"resettled": rows}


def change(block: VariableBlock, before: Array, after: Array) -> float | None:
    """|after - before| / |before| of one variable's part of a gradient, in its scale; None where it is flat."""
    part = slice(block.start, block.stop)
    norm = float(np.linalg.norm(before[part] * block.scale))
    return float(np.linalg.norm((after - before)[part] * block.scale)) / norm if norm else None


def order(values: Sequence[ArrayLike]) -> float | None:
    """p of an error like dt^p, from values (of any one shape) at dt, dt / 2 and dt / 4; None within rounding."""
    coarse, middle, fine = (np.asarray(value, float) for value in values)
    first, second = float(np.linalg.norm(coarse - middle)), float(np.linalg.norm(middle - fine))
    least = ROUNDING * float(np.linalg.norm(fine))
    if not (least < first < np.inf and least < second < np.inf):
        return None
    return float(np.log2(first / second))


@lru_cache(maxsize=len(TOLD) + 1)
def finer_problem(transcription: Transcription, what: str) -> Transcription:
    """Refined so; made once for all runs of a problem."""
    problem = transcription.problem
    simulation = problem.simulation
    finer = {
        FINER_DT: replace(simulation, dt=simulation.dt / 2),
        FINEST_DT: replace(simulation, dt=simulation.dt / 4),
        MORE_SWEEPS: replace(simulation, sweeps=2 * simulation.sweeps),
        ONE_MORE: replace(simulation, sweeps=simulation.sweeps + 1),
    }
    return transcribe(replace(problem, simulation=finer[what]), backend="casadi", like=transcription.rollout)
