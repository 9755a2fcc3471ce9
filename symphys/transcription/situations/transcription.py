"""The transcription of a problem with scenarios."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter
from typing import Literal

from symphys.backends import BEST, Description
from symphys.kernel import Kernel, KernelUnavailable, ProgramError, compile_program, processors
from symphys.problem import Problem
from symphys.shooting import Nlp
from symphys.transcription.along import symbolic_rollout
from symphys.transcription.program import rollout_program
from symphys.transcription.situations.evaluator import KernelSituations, NominalEvaluator
from symphys.transcription.situations.sampler import Sampler
from symphys.transcription.transcription import Transcription

Precision = Literal["double", "single"]
KERNELS = {BEST: "double", "simd": "double", "simd32": "single"}
WITHOUT = "there is no evaluation in other situations"


def with_situations(
    plain: Transcription, problem: Problem, exact: bool, backend: str, threads: int | None
) -> Transcription:
    """``plain``, which is of the problem without its scenarios, with kernels that know them in place of its backend.

    Where there can be no kernels it stays as it is, and its backend's note says so.
    """
    began = perf_counter()
    try:
        if backend not in KERNELS:
            raise KernelUnavailable(f"the backend {backend} has no situations")
        situations = _situations(problem, exact, backend, processors() if threads is None else threads)
    except (KernelUnavailable, ProgramError) as error:
        told = replace(plain.backend, note=f"{WITHOUT}: {error}")
        return replace(plain, problem=problem, backend=told)
    shooting = replace(
        plain.shooting, evaluator=NominalEvaluator(situations), situations=situations, squares=False, nlp=Nlp(None)
    )
    told = _description(situations.kernels, perf_counter() - began)
    return replace(plain, problem=problem, shooting=shooting, backend=told)


def _situations(problem: Problem, exact: bool, backend: str, threads: int) -> KernelSituations:
    assert problem.scenarios is not None, "nothing differs"
    grids = {"": problem.simulation, **{grid.name: grid.simulation for grid in problem.scenarios.grids}}
    samplers = [Sampler(replace(problem, simulation=simulation)) for simulation in grids.values()]
    precision: Precision = "single" if backend == "simd32" else "double"
    return KernelSituations(list(grids), samplers, [_kernel(each, exact, precision, threads) for each in samplers])


def _kernel(sampler: Sampler, exact: bool, precision: Precision, threads: int) -> Kernel:
    program = rollout_program(symbolic_rollout(sampler.problem), exact)
    return compile_program(program, seeded=("merit",), threads=threads, precision=precision)


def _description(kernels: tuple[Kernel, ...], seconds: float) -> Description:
    report, cached = kernels[0].report, all(kernel.report.cached for kernel in kernels)
    name = "simd" if report.precision == "double" else "simd32"
    note = f"{len(kernels)} discretisations" if len(kernels) > 1 else ""
    return Description(
        name, report.lanes, kernels[0].threads, report.precision, report.compiler, cached, seconds, report.note or note
    )
