"""How far to trust a solution: derivatives against differences, and the answer under finer time steps and sweeps."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from symphys.problem import Problem
from symphys.shooting import Block
from symphys.trajectory import Trajectory
from symphys.transcription import Judge, Transcription, judge_for

Array = NDArray[np.float64]

DIFFERENCE_STEPS = (1e-4, 1e-5, 1e-6)
"""Steps of the central differences, as shares of the scale; the best counts, and a wrong slope passes none."""
EVERY_COMPONENT = 12
"""Variables up to this size are differenced component by component, larger ones along as many random directions."""


def examine(transcription: Transcription, z: Array) -> dict[str, Any]:
    """The "trust" object of a result, for the exact rollout of ``z``.

    gradient: per variable |adjoint - central difference| / scale, where scale is the norm of the variable's slope.
    refined: objective and worst check with dt halved, and with sweeps doubled.
    residual [N s], deepest [m], multiple_impacts: how converged the contacts were in the rollout.
    """
    return {
        "gradient": compare_gradient(transcription, z),
        "refined": [refined(what, judge, z) for what, judge in finer_judges(transcription)],
        **_contacts(transcription, transcription.simulate(z)),
    }


def compare_gradient(transcription: Transcription, z: Array) -> list[dict[str, Any]]:
    """Adjoint against central differences, per variable.

    What is differentiated is a fixed random combination of everything that the problem asks for (residuals,
    constraints, costs), because at a solution the gradient of the objective itself is zero.
    """
    value, gradient = probe(transcription)
    slope = np.array(gradient(z)).ravel()
    return [_compare_block(value, block, z, slope) for block in transcription.shooting.blocks]


def refined(what: str, judge: Judge, z: Array) -> dict[str, Any]:
    """How ``z`` does in another discretisation of the problem."""
    verdict = judge(z)
    return {"what": what, "objective": verdict.objective, "worst": verdict.worst}


@lru_cache(maxsize=1)
def finer_judges(transcription: Transcription) -> list[tuple[str, Judge]]:
    """Judges of the finer problems, made once for all runs of a problem."""
    return [(what, judge_for(problem)) for what, problem in _finer(transcription.problem)]


def _finer(problem: Problem) -> list[tuple[str, Problem]]:
    simulation = problem.simulation
    return [
        ("dt / 2", replace(problem, simulation=replace(simulation, dt=simulation.dt / 2))),
        ("sweeps x 2", replace(problem, simulation=replace(simulation, sweeps=2 * simulation.sweeps))),
    ]


@lru_cache(maxsize=1)
def probe(transcription: Transcription) -> tuple[ca.Function, ca.Function]:
    """(z -> weights . everything asked for, z -> its gradient), exact contact."""
    terms, rollout = transcription.terms, transcription.rollout
    asked = terms.objective if terms.residuals is None else terms.residuals
    everything = ca.vertcat(ca.vec(asked), terms.constraints)
    weights = np.random.default_rng(0).uniform(0.5, 1.5, everything.shape[0])
    combined = ca.dot(ca.DM(weights), ca.densify(everything))
    z = ca.MX.sym("z", rollout.z.shape[0])

    def exact(name: str, output: Any) -> ca.Function:
        smooth = ca.Function(name, [rollout.z, rollout.smoothing], [output])
        return ca.Function(name, [z], [smooth(z, 0)])

    return exact("probe", combined), exact("probe_gradient", ca.gradient(combined, rollout.z))


def _compare_block(value: ca.Function, block: Block, z: Array, slope: Array) -> dict[str, Any]:
    size = block.stop - block.start
    norm = float(np.linalg.norm(slope[block.start : block.stop]))
    best, at = np.inf, 0.0
    for step in DIFFERENCE_STEPS:
        error = max(_mismatch(value, z, slope, direction, step) for direction in _directions(block, size, z.size))
        best, at = min((best, at), (error, step))
    return {"variable": block.name, "error": best / norm if norm else best, "scale": norm, "step": at}


def _directions(block: Block, size: int, n: int) -> Array:
    """(k, n): unit steps in the scale of each component, or random combinations of many."""
    inside = np.eye(size)
    if size > EVERY_COMPONENT:
        inside = np.random.default_rng(1).standard_normal((EVERY_COMPONENT, size))
        inside /= np.linalg.norm(inside, axis=1, keepdims=True)
    whole = np.zeros((len(inside), n))
    whole[:, block.start : block.stop] = inside * block.scale
    return whole


def _mismatch(value: ca.Function, z: Array, slope: Array, direction: Array, step: float) -> float:
    high, low = (float(value(z + sign * step * direction)) for sign in (1, -1))
    return abs((high - low) / (2 * step) - float(slope @ direction)) / float(np.linalg.norm(direction))


def _contacts(transcription: Transcription, motion: Trajectory) -> dict[str, Any]:
    rigid = [not pair.law.soft for pair in transcription.rollout.world.pairs]
    gaps = motion.contact_gap[:, rigid]
    return {
        "residual": float(motion.residual.max(initial=0.0)),
        "deepest": float(max(0.0, -gaps.min(initial=0.0))),
        "multiple_impacts": int(motion.crowded.sum()),
    }
