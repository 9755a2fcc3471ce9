"""The transcription of a problem with scenarios."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

from symphys.codegen import Kernel, KernelUnavailable, ProgramError, processors
from symphys.codegen.backends import PRECISIONS, build_kernel, described
from symphys.codegen.toolchain.warm_start import ProgramSource
from symphys.problem import Problem
from symphys.shooting import Nlp
from symphys.transcription.program import program_identity, rollout_program
from symphys.transcription.randomization.evaluator import KernelScenarioEvaluator, NominalEvaluator
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
    began = perf_counter()
    try:
        if backend not in PRECISIONS:
            raise KernelUnavailable(f"the backend {backend} cannot draw samples of scenarios")
        scenario = _evaluator(problem, exact, backend, processors() if threads is None else threads)
    except (KernelUnavailable, ProgramError) as error:
        description = replace(plain.backend, note=f"{WITHOUT}: {error}")
        return replace(plain, problem=problem, backend=description)
    shooting = replace(
        plain.shooting, evaluator=NominalEvaluator(scenario), scenario=scenario, squares=False, nlp=Nlp(None)
    )
    grids = f"{len(scenario.kernels)} discretisations" if len(scenario.kernels) > 1 else ""
    description = described(scenario.kernels[0], perf_counter() - began, note=grids)
    cached = all(kernel.report.cached for kernel in scenario.kernels)
    return replace(plain, problem=problem, shooting=shooting, backend=replace(description, cached=cached))


def _evaluator(problem: Problem, exact: bool, backend: str, threads: int) -> KernelScenarioEvaluator:
    assert problem.scenarios is not None, "nothing differs"
    grids = {"": problem.simulation, **{grid.name: grid.simulation for grid in problem.scenarios.discretisations}}
    samplers = [Sampler(replace(problem, simulation=simulation)) for simulation in grids.values()]
    return KernelScenarioEvaluator(list(grids), samplers, [_kernel(each, exact, backend, threads) for each in samplers])


def _kernel(sampler: Sampler, exact: bool, backend: str, threads: int) -> Kernel:
    problem = sampler.problem
    source = ProgramSource(lambda: rollout_program(symbolic_rollout(problem), exact), program_identity(problem, exact))
    return build_kernel(backend, source, ("merit",), threads)
