"""The contents of result.json and trace.csv, made from the outcome of a solver."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from symphys import files
from symphys import json_values as values
from symphys.codegen.backends import Description
from symphys.findings.levels import Judged
from symphys.findings.verdict import judge_run
from symphys.problem import Problem, Variable
from symphys.problem.quantities import formula_units
from symphys.records import dataclass
from symphys.results.result import (
    REACHED,
    BackendRecord,
    CheckRecord,
    Result,
    StageRecord,
    VariableRecord,
    verdict_fields,
)
from symphys.results.trace import OUTPUT
from symphys.runs.job import Job
from symphys.runs.provenance import provenance as origin
from symphys.runs.provenance import versions
from symphys.shooting import VariableBlock
from symphys.solvers import Counts, Outcome, StageResult, Status, TraceRow
from symphys.trajectory import Trajectory
from symphys.transcription import Assessment, Transcription
from symphys.transcription.decision_variables import blocks as blocks_of
from symphys.types import Array

JUDGED = frozenset(("objective", "costs", "outputs", "checks"))
"""Fields that are unknown where the exact rollout cannot be simulated."""


@dataclass(frozen=True)
class Judgement:
    """The exact rollout of the solution; all None where it cannot be simulated.

    Attributes:
        verdict: costs and checks.
        trajectory: the motion.
        trust: how far the solution can be trusted, or, not examined, what is always measured; None also for a run that
            is not over.
        advice: the solver's and what the rollout adds.
    """

    verdict: Assessment | None
    trajectory: Trajectory | None
    trust: dict[str, Any] | None
    advice: str


def make_result(
    job: Job,
    transcription: Transcription,
    outcome: Outcome,
    judgement: Judgement,
    price: dict[str, float],
    seconds: dict[str, float],
) -> Result:
    """Return the result of a run that its solver ended."""
    verdict = judgement.verdict
    found: dict[str, Any] = {}
    if verdict:
        found = {"objective": verdict.objective, "costs": dict(verdict.costs), "outputs": dict(verdict.outputs)}
        found["checks"] = tuple(
            CheckRecord(check.kind, check.name, check.error, check.tolerance, check.ratio, check.met, check.unit)
            for check in verdict.checks
        )
    return Result(
        **provenance(job, transcription.backend.flags),
        **found,
        backend=evaluated_by(transcription.backend),
        **verdict_fields(judge_run(outcome.status.value, judged(verdict), files.strict(judgement.trust))),
        status=outcome.status.value,
        advice=judgement.advice,
        z=variables(transcription.problem, transcription.shooting.blocks, outcome.z),
        iterations=outcome.trace[-1].iteration if outcome.trace else 0,
        counts=asdict(outcome.counts),
        price=price,
        equivalents=equivalents(outcome.counts, price),
        seconds=seconds,
        trust=judgement.trust or {},
        guess=guess_values(transcription, job.config.seed),
        stages=tuple(stage_record(transcription, stage, price) for stage in outcome.stages),
        absent=(frozenset() if verdict else JUDGED) | (frozenset() if judgement.trust else {"trust"}),
    )


def failure(job: Job, message: str, again: bool = False) -> Result:
    """Return the result of a run that could not be done; ``again``: the same command should try it again."""
    return Result(**provenance(job), solved=False, status="failed", advice=message, again=again, absent=REACHED)


def interruption(job: Job, message: str, checkpoint: Mapping[str, object] | None) -> Result:
    """Return the result of a run that a limit ended: the best point of its checkpoint, not judged."""
    kept = checkpoint or {}
    known: dict[str, Any] = {}
    rows = checkpoint_rows(checkpoint)
    z, blocks = values.numbers(values.table(kept.get("best")).get("z")), blocks_of(job.problem)
    if z.size and z.size == blocks[-1].stop:
        counts = values.numbers(kept.get("counts"))
        known = {
            "z": variables(job.problem, blocks, z),
            "iterations": rows[-1]["iteration"] if rows else np.nan,
            "counts": dict(zip([each.name for each in fields(Counts)], counts.tolist(), strict=False)),
            "seconds": {"solve": values.number(kept.get("seconds"))},
        }
    status, unread = Status.INTERRUPTED.value, judged(None)
    return Result(
        **provenance(job),
        **verdict_fields(judge_run(status, unread, None)),
        **known,
        status=status,
        advice=message,
        absent=REACHED - known.keys(),
    )


def checkpoint_rows(checkpoint: Mapping[str, object] | None) -> list[dict[str, object]]:
    """Return the iterations of a checkpoint as rows of trace.csv; none if it cannot be read."""
    rows = (checkpoint or {}).get("rows")
    names = [each.name for each in fields(TraceRow)]
    whole = [row for row in rows if isinstance(row, list) and len(row) == len(names)] if isinstance(rows, list) else []
    found = [dict(zip(names, row, strict=True)) for row in whole]
    return [
        {**row, **{OUTPUT + key: number for key, number in values.table(row.pop("outputs")).items()}} for row in found
    ]


def judged(verdict: Assessment | None) -> Judged:
    """Return the summary of an exact rollout; NaN where there is none."""
    if verdict is None:
        return Judged(np.nan, np.nan, met=False, checked=False)
    return Judged(verdict.objective, verdict.worst, verdict.solved, bool(verdict.checks))


def variables(problem: Problem, blocks: Sequence[VariableBlock], z: Array) -> dict[str, VariableRecord]:
    """Return the variables by name."""
    sets = {v.name: tuple(slot.name for slot in v.slots) for v in problem.variables}
    units = formula_units(problem.world(), (), problem.variables)
    duration, named = duration_of(problem, z, blocks), {v.name: v for v in problem.variables}

    def block(flat: Array, shape: tuple[int, int]) -> Array:
        return flat.reshape(shape[::-1]).T

    return {
        each.name: VariableRecord(
            each.name,
            sets[each.name],
            value=block(z[each.start : each.stop], each.shape),
            guess=block(each.guess, each.shape),
            lower=block(each.lower, each.shape),
            upper=block(each.upper, each.shape),
            unit=units.get(each.name, ""),
            **knot_times(named[each.name], duration),
        )
        for each in blocks
    }


def duration_of(problem: Problem, z: Array, blocks: Sequence[VariableBlock]) -> float:
    """Return how long [s] the motion of z takes."""
    chosen = {variable.name for variable in problem.variables if variable.kind == "duration"}
    return next((float(z[each.start]) for each in blocks if each.name in chosen), problem.simulation.duration)


def knot_times(variable: Variable, duration: float) -> dict[str, Any]:
    """Return ``time`` and ``held`` of a ``VariableRecord``."""
    if variable.knots < 2:
        return {}
    linear = variable.interpolation == "linear"
    held = 0.0 if linear else duration / variable.knots
    return {"time": np.linspace(0, duration, variable.knots, endpoint=linear), "held": held}


def guess_values(transcription: Transcription, seed: int) -> dict[str, float]:
    """Judge the starting point of a seed by the exact rollout."""
    exact = transcription.judge(transcription.shooting.start(seed))
    outputs = {OUTPUT + name: value for name, value in exact.outputs.items()}
    return {"objective": exact.objective, "worst": exact.worst, **outputs}


def stage_record(transcription: Transcription, stage: StageResult, price: Mapping[str, float]) -> StageRecord:
    """Return the record of a stage; its point is judged by the exact rollout, outside its time."""
    exact = transcription.judge(stage.z)
    return StageRecord(
        smoothing=stage.smoothing,
        status=stage.status.value,
        objective=stage.objective,
        worst=stage.max_violation,
        exact_objective=exact.objective,
        exact_worst=exact.worst,
        solved=exact.solved,
        counts=asdict(stage.counts),
        equivalents=equivalents(stage.counts, price),
        seconds=stage.seconds,
    )


def trace_row(row: TraceRow, price: Mapping[str, float]) -> dict[str, object]:
    """Return an iteration as a row of trace.csv."""
    values = {each.name: getattr(row, each.name) for each in fields(row)}
    numbers = {name: value for name, value in values.items() if not isinstance(value, Mapping)}
    outputs = {OUTPUT + name: value for name, value in row.outputs.items()}
    return {**numbers, "equivalents": equivalents(row, price), **outputs}


def used(counts: Counts) -> list[str]:
    """Return the kinds of evaluation whose price matters for these counts."""
    return ["gradient", *(kind for kind, count in priced(counts).items() if count and kind != "gradient")]


def priced(counts: Counts | TraceRow) -> dict[str, int]:
    """Return the number of evaluations of each kind that costs more than a rollout."""
    return {"gradient": counts.gradients, "jacobian": counts.jacobians, "hessian": counts.hessians}


def equivalents(counts: Counts | TraceRow, price: Mapping[str, float]) -> float:
    """Return the cost in rollouts: each evaluation times its measured price."""
    return float(counts.rollouts + sum(count * price[kind] for kind, count in priced(counts).items() if count))


def provenance(job: Job, flags: Sequence[str] = ()) -> dict[str, Any]:
    """Return the fields of a result that are known however the run ends: identity and origin of the run.

    ``flags``: with which a compiler made what evaluated; none where nothing was compiled.
    """
    known = {"flags": " ".join(flags), "chosen": job.chosen, "guess": job.guess.folder}
    return {
        "problem": job.config.problem,
        "title": job.problem.title,
        "solver": job.config.solver,
        "seed": job.config.seed,
        "versions": versions(),
        "provenance": origin() | {key: text for key, text in known.items() if text},
        "when": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "command": job.command,
    }


def evaluated_by(backend: Description) -> BackendRecord:
    """Return the ``backend`` entry of a result."""
    compiled = "" if backend.cached is None else "warm" if backend.cached else "cold"
    return BackendRecord(
        backend.name, backend.lanes, backend.threads, backend.precision, backend.compiler, backend.said(), compiled
    )
