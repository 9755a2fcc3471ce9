"""The answer and its gradient under finer time steps, more sweeps, and smoothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symphys.codegen.backends.calls import row_by_row
from symphys.model.state_layout import Layout
from symphys.shooting import VariableBlock
from symphys.trajectory import NotFinite
from symphys.transcription import Assessment, Record, Rollout, Transcription, transcribe_finer
from symphys.types import Array
from symphys.verification.bodies import Bodies, bodies, floating

FINER_DT, FINEST_DT, MORE_SWEEPS, ONE_MORE = "dt / 2", "dt / 4", "sweeps x 2", "sweeps + 1"
TOLD = {what: f"simulating with {what}" for what in (FINER_DT, FINEST_DT, MORE_SWEEPS)}
"""The message that announces each refinement, in order."""
MOST_CHANGE = 1.5
"""The change by dt / 4 in units of that by dt / 2, of an error of first order."""
SURE_SLOPE, SURE_OBJECTIVE = 0.1, 0.05
"""Relative changes by dt / 4 up to which a gradient and an objective are good; see ``symphys.findings.numerics``."""
SETTLED = 1e-3
"""Residuals below this share of the largest impulse are negligible."""
UNSETTLED = 5e-2
"""Residuals above this share of the largest impulse mean that impulses have not settled."""
LEFT_RESIDUAL = 1e-4
"""Residuals below this share of the largest impulse leave no significant velocity error."""
CYCLING = 0.5
"""Share of a residual left by twice the sweeps above which the solver cycles and more sweeps do not help."""
MAX_STEPS = 5
"""Steps with the largest velocity errors, which are followed further."""
LATER = 10
"""Steps after which a velocity error counts."""
ROUNDING = 1e-9
"""Relative changes below this are rounding, and show no order of convergence."""
TRIED_SMOOTHING = (1e-3, 1e-2, 1e-1)
"""[m/s] Smoothings that are tried where the problem itself has none."""


def refine(
    transcription: Transcription,
    z: Array,
    tell: Callable[[str], None] = lambda what: None,
    whole: bool = True,
    settled: bool = False,
    slopes: bool = True,
) -> dict[str, Any]:
    """Judge ``z`` in finer discretisations; ``tell`` is called with the name of each before it is simulated.

    Args:
        transcription: of a problem.
        z: (n,).
        tell: see above.
        whole: whether all are done. Else dt / 4 is left out where it follows from dt / 2, see ``follows``, twice the
            sweeps where impulses have settled, and all gradients but that of dt / 2, which take longest.
        settled: whether they have.
        slopes: whether gradients are compared.

    Returns:
        "refined": for dt / 2, dt / 4 and twice the sweeps the "objective", the "worst" error / tolerance, and
        "gradient": per variable the change of the probe's gradient relative to its norm, in the variables' scales;
        None where it is flat.
        "order": of convergence in dt, of the "objective" and of the "gradient"; None where it cannot be seen.
    """
    judged = transcription.judge(z)
    gradients = [transcription.probe.gradient(z)] if slopes else []
    objectives, rows = [judged.objective], list[dict[str, Any]]()
    for what in TOLD:
        if not whole and (settled if what == MORE_SWEEPS else what == FINEST_DT and follows(judged, rows[0])):
            continue
        tell(TOLD[what])
        finer, changes = finer_problem(transcription, what), dict[str, float | None]()
        verdict = finer.judge(z)
        if slopes and (whole or what == FINER_DT):
            slope = finer.probe.gradient(z)
            changes = {block.name: change(block, gradients[0], slope) for block in transcription.shooting.blocks}
            gradients += [slope] * (what != MORE_SWEEPS)
        objectives += [verdict.objective] * (what != MORE_SWEEPS)
        rows.append({"what": what, "objective": verdict.objective, "worst": verdict.worst, "gradient": changes})
    return {"refined": rows, "order": {"objective": order(objectives), "gradient": order(gradients)}}


def finer_value(transcription: Transcription, z: Array, what: str) -> dict[str, Any]:
    """Return a row "refined" of ``refine`` without gradients."""
    verdict = finer_problem(transcription, what).judge(z)
    return {"what": what, "objective": verdict.objective, "worst": verdict.worst, "gradient": {}}


def finer_errors(transcription: Transcription, Z: Array, refuted: float) -> Array:
    """Return (B, k) error / tolerance of each check of Z (B, n) with dt / 2 and dt / 4, the larger one, or NaN.

    Where dt / 2 alone leads to more than ``refuted`` in a check, dt / 4 is not tried.
    """
    found = finer_problem(transcription, FINER_DT).errors(Z)
    held = np.flatnonzero((found <= refuted).all(axis=1))
    if len(held):
        found[held] = np.maximum(found[held], finer_problem(transcription, FINEST_DT).errors(Z[held]))
    return found


def follows(judged: Assessment, row: dict[str, Any]) -> bool:
    """Whether dt / 4 agrees if dt / 2, the ``row`` of ``refine``, does: where errors shrink like dt or faster.

    The change by dt / 4 is then at most one and a half times that by dt / 2.
    """
    slopes = [each for each in row["gradient"].values() if each is not None]
    if not all(MOST_CHANGE * each <= SURE_SLOPE for each in slopes):
        return False
    if judged.solved and judged.checks:
        return bool(judged.worst + MOST_CHANGE * max(row["worst"] - judged.worst, 0.0) <= 1)
    return bool(MOST_CHANGE * abs(row["objective"] - judged.objective) <= SURE_OBJECTIVE * abs(judged.objective))


def settling(transcription: Transcription, z: Array, residual: float, impulse: float) -> dict[str, float]:
    """Return "residual_finer" [N s], the residual with twice the sweeps, if the residual is not negligible.

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
    """Judge ``z`` with other numbers of sweeps, if impulses have not settled.

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


def left(transcription: Transcription, record: Record, residual: float, impulse: float) -> dict[str, Any]:
    """Estimate the velocities of bodies without joints that the sweeps of a step have missed.

    Each recorded step is taken again from its state with twice the sweeps, so that what a motion makes of a small
    difference later does not count. What is left falls in the same ratio as the residual: a velocity that changes by d
    while the residual falls to its share q was off by d / (1 - q). Steps in which the residual does not fall to half
    are not counted; see ``resettled``. Of the steps in which most is left, the motion goes on for ``LATER`` steps from
    where twice the sweeps led, since contacts that last put right what a body that flies off keeps.

    Returns:
        "left": the largest velocity that is off then, as a share of the largest in the motion, or of what gravity
        gives in a step. "left_at": the body's "name", "time" [s] and "speed" [m/s]; None where nothing is left.
        Nothing where the ``residual`` is small beside the largest ``impulse`` of a contact in a step [N s].
    """
    rollout, arrays, motion = transcription.timed(record).rollout, record.arrays, record.motion
    free = [group[0] for group in floating(rollout) if len(group) == 1]
    if not (free and residual > LEFT_RESIDUAL * impulse > 0):
        return {}
    finer = finer_problem(transcription, MORE_SWEEPS).timed(record).rollout
    settled, _, _, residuals, *_ = row_by_row(finer.report, arrays.x[:-1], arrays.u, arrays.p, [0.0])
    share = residuals[:, 0] / np.maximum(motion.residual, np.finfo(float).tiny)
    scale = np.where(share > CYCLING, 0.0, 1 / np.maximum(1 - share, 1 - CYCLING))
    numbers = bodies(rollout, record)
    off = scale[:, None] * speeds(rollout, numbers, settled - arrays.x[1:])[:, free]
    stays = np.zeros_like(off)
    for k in np.argsort(-off.max(axis=1), kind="stable")[:MAX_STEPS]:
        x, end = settled[k], min(k + 1 + LATER, rollout.steps)
        for later in range(k + 1, end):
            x = np.array(rollout.report(x, arrays.u[later], arrays.p, 0.0)[0]).ravel()
        stays[k] = scale[k] * speeds(rollout, numbers, (x - arrays.x[end])[None])[0, free]
    k, b = np.unravel_index(int(stays.argmax()), stays.shape)
    worst = float(stays[k, b])
    if not worst > 0:
        return {"left": 0.0, "left_at": None}
    given = rollout.dt * float(np.linalg.norm(numbers.gravity, axis=1).max())
    largest = float(speeds(rollout, numbers, arrays.x).max()) + given
    at = {"name": motion.body_names[free[b]], "time": float(motion.time[k]), "speed": worst}
    return {"left": worst / largest, "left_at": at}


def speeds(rollout: Rollout, numbers: Bodies, x: Array) -> Array:
    """Return speeds (N, B) [m/s] of states or their differences (N, nx): of centres, or at the radius of gyration."""
    layout, names = Layout(rollout.world), [body.name for body in rollout.world.bodies]
    linear, angular = (
        np.stack([np.linalg.norm(x[:, layout[f"{name}.{field}"]], axis=1) for name in names], axis=1)
        for field in ("velocity", "angular_velocity")
    )
    found: Array = np.maximum(linear, numbers.size * angular)
    return found


def change(block: VariableBlock, before: Array, after: Array) -> float | None:
    """Return |after - before| / |before| of one variable's part of a gradient, in its scale; None where it is flat."""
    part = slice(block.start, block.stop)
    norm = float(np.linalg.norm(before[part] * block.scale))
    return float(np.linalg.norm((after - before)[part] * block.scale)) / norm if norm else None


def order(values: Sequence[ArrayLike]) -> float | None:
    """Return p of an error like dt^p, from values at dt, dt / 2 and dt / 4; None within rounding, or without these."""
    if len(values) < 3:
        return None
    coarse, middle, fine = (np.asarray(value, float) for value in values)
    first, second = float(np.linalg.norm(coarse - middle)), float(np.linalg.norm(middle - fine))
    least = ROUNDING * float(np.linalg.norm(fine))
    if not (least < first < np.inf and least < second < np.inf):
        return None
    return float(np.log2(first / second))


@lru_cache(maxsize=len(TOLD) + 1)
def finer_problem(transcription: Transcription, what: str) -> Transcription:
    """Transcribe the refined problem; once for all runs of a problem."""
    simulation = transcription.problem.simulation
    finer = {
        FINER_DT: replace(simulation, dt=simulation.dt / 2),
        FINEST_DT: replace(simulation, dt=simulation.dt / 4),
        MORE_SWEEPS: replace(simulation, sweeps=2 * simulation.sweeps),
        ONE_MORE: replace(simulation, sweeps=simulation.sweeps + 1),
    }
    return transcribe_finer(transcription, finer[what])


def smoothed(transcription: Transcription, record: Record, whole: bool = True) -> list[dict[str, Any]]:
    """Compare the exact motion of ``record`` with smoothed rollouts.

    Args:
        transcription: of a problem.
        record: of it.
        whole: whether ``TRIED_SMOOTHING`` is tried where the problem has none of its own, which no verdict rests on.

    Returns:
        For each "smoothing" [m/s] of the problem's own stages, or of ``TRIED_SMOOTHING``, the "objective", the "worst"
        error / tolerance and "costs", the sum of what is minimised; "own" says which it is. "moved": how far bodies get
        from their places in the exact motion, as a share of the longest way of one.
    """
    z = record.z
    own = [smoothing for smoothing in transcription.problem.simulation.smoothing if smoothing > 0]
    rows = []
    for smoothing in own or TRIED_SMOOTHING * whole:
        verdict = transcription.judge(z, smoothing)
        found = {"objective": verdict.objective, "worst": verdict.worst, "costs": sum(verdict.costs.values())}
        moved = _moved(record, transcription, smoothing)
        rows.append({"smoothing": smoothing, "own": bool(own), **found, "moved": moved})
    return rows


def _moved(record: Record, transcription: Transcription, smoothing: float) -> float:
    """Return the "moved" of a smoothing; NaN if there is no such motion, or no body moves."""
    place, world = record.motion.position, transcription.rollout.world
    way = float(np.linalg.norm(place - place[0], axis=2).max(initial=0.0))
    x, layout = transcription.arrays(record.z, smoothing).x, Layout(world)
    if not (way and np.isfinite(x).all()):
        return float("nan")
    other = np.stack([x[:, layout[f"{body.name}.position"]] for body in world.bodies], axis=1)
    return float(np.linalg.norm(other - place, axis=2).max(initial=0.0)) / way
