"""The transcription of a problem with scenarios."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

from symphys.codegen import KernelUnavailable, ProgramError, processors
from symphys.codegen.backends import PRECISIONS, Description, build_kernel, described
from symphys.codegen.backends.interface import joined
from symphys.codegen.toolchain.warm_start import ProgramSource
from symphys.problem import Problem
from symphys.shooting import Nlp
from symphys.transcription.network_rollout.context import make_context
from symphys.transcription.network_rollout.partition import has_large_nets
from symphys.transcription.network_rollout.transcription import large_evaluator
from symphys.transcription.program import program_identity, rollout_program
from symphys.transcription.randomization.evaluator import (
    KernelSamples,
    NominalEvaluator,
    SampledEvaluator,
    SampleEvaluator,
)
from symphys.transcription.randomization.sampler import Sampler
from symphys.transcription.rollout import symbolic_rollout
from symphys.transcription.transcription import Transcription

WITHOUT = "there are no samples of scenarios"


def with_scenarios(
    plain: Transcription, problem: Problem, exact: bool, backend: str, threads: int | None
) -> Transcription:
    """``plain``, which is of the problem without its scenarios, with kernels that know them in place of its backend.

    Where there can be no kernels it stays as it is, and its backend's note says so.
    """
    began, count = perf_counter(), processors() if threads is None else threads
    assert problem.scenarios is not None, "nothing differs"
    grids = {"": problem.simulation, **{grid.name: grid.simulation for grid in problem.scenarios.discretisations}}
    try:
        if backend not in PRECISIONS:
            raise KernelUnavailable(f"the backend {backend} cannot draw samples of scenarios")
        samplers = [Sampler(replace(problem, simulation=simulation)) for simulation in grids.values()]
        made = [_evaluating(each.problem, exact, backend, count) for each in samplers]
    except (KernelUnavailable, ProgramError) as error:
        description = replace(plain.backend, note=f"{WITHOUT}: {error}")
        return replace(plain, problem=problem, backend=description)
    scenario = SampledEvaluator(list(grids), samplers, [evaluator for evaluator, _ in made])
    shooting = replace(
        plain.shooting, evaluator=NominalEvaluator(scenario), scenario=scenario, squares=False, nlp=Nlp(None)
    )
    note = joined(made[0][1].note, f"{len(grids)} discretisations" if len(grids) > 1 else "")
    cached = all(description.cached for _, description in made)
    description = replace(made[0][1], seconds=perf_counter() - began, note=note, cached=cached)
    return replace(plain, problem=problem, shooting=shooting, backend=description)


def _evaluating(problem: Problem, exact: bool, backend: str, threads: int) -> tuple[SampleEvaluator, Description]:
    """What evaluates the samples of one grid: a kernel, or steps by a kernel with large nets between them."""
    if has_large_nets(problem):
        return large_evaluator(make_context(problem), exact, backend, threads)
    source = ProgramSource(lambda: rollout_program(symbolic_rollout(problem), exact), program_identity(problem, exact))
    kernel = build_kernel(backend, source, ("merit",), threads)
    return KernelSamples(kernel), described(kernel, 0.0)
