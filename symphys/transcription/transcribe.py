"""From a problem to its transcription: one rollout, as the shooting problem that solvers see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from time import perf_counter

from symphys.codegen.backends import BEST, Backend, BackendSource, choose
from symphys.problem import GuessedMotion, Problem
from symphys.shooting import GuessedStates, ShootingProblem, StagedProblem
from symphys.transcription.decision_variables import blocks
from symphys.transcription.functions import ExpressionFunctions
from symphys.transcription.network_rollout import has_large_nets
from symphys.transcription.objective import bounds, has_squares, limits
from symphys.transcription.program import program_identity, rollout_program
from symphys.transcription.randomization.sampler import swept_inputs
from symphys.transcription.rollout import Rollout, symbolic_rollout
from symphys.transcription.shared_kernel import shared_backend
from symphys.transcription.transcription import Transcription


def transcribe(
    problem: Problem,
    exact: bool = False,
    backend: str = BEST,
    threads: int | None = None,
) -> Transcription:
    """Transcribe a problem for solving, judging and recording.

    Args:
        problem: what to solve.
        exact: whether smoothing 0 is all that will be asked for; kernels then leave the smoothing out.
        backend: what evaluates it, a name of ``symphys.codegen.backends.NAMES``.
        threads: that share a batch; None: one for each processor.

    Example:
        >>> import symphys
        >>> from symphys.transcription import transcribe
        >>> made = transcribe(symphys.load("ball_throw"), backend="casadi")
        >>> made.judge(made.shooting.start(0)).solved, made.shooting.n
        (False, 6)
    """
    if problem.scenarios is not None:
        from symphys.transcription.randomization.transcription import with_scenarios

        plain = transcribe(replace(problem, scenarios=None), exact, "casadi", threads)
        return with_scenarios(plain, problem, exact, backend, threads)
    if has_large_nets(problem):
        from symphys.transcription.network_rollout import transcribe_large

        return transcribe_large(problem, exact, backend, threads)
    return transcribe_whole(problem, exact, backend, threads)


def transcribe_whole(problem: Problem, exact: bool, backend: str, threads: int | None) -> Transcription:
    """Transcribe a problem without its scenarios as one expression; nets of any size are part of the step."""
    began = perf_counter()
    rollout = symbolic_rollout(problem)
    functions = ExpressionFunctions(rollout)
    names, lower, upper = bounds(problem, lambda formula: int(rollout.compiled(formula).size1_out(0)))
    built = perf_counter() - began
    chosen = _evaluating(rollout, functions, exact, backend, threads)
    staged = cache(lambda: _stages(rollout, backend, threads, exact or not any(problem.simulation.smoothing)))
    shooting = ShootingProblem(
        name=problem.name,
        blocks=blocks(problem),
        evaluator=chosen.evaluator,
        nlp=chosen.nlp,
        squares=has_squares(problem),
        constraint_names=names,
        constraint_lower=lower,
        constraint_upper=upper,
        limits=limits(problem),
        smoothing=problem.simulation.smoothing,
        stop_when_met=problem.stop_when_met,
        output_names=tuple(output.label for output in problem.outputs),
        staged=staged,
        guessed_states=states_of(staged, problem.guess),
    )
    return Transcription(problem, rollout, functions, shooting, chosen.description, built)


def _stages(rollout: Rollout, backend: str, threads: int | None, exact: bool) -> StagedProblem:
    """Return the staged problem, built on demand."""
    from symphys.transcription.staged.staged_problem import RolloutStages

    return RolloutStages(rollout, backend, threads, exact)


def _evaluating(
    rollout: Rollout, functions: ExpressionFunctions, exact: bool, backend: str, threads: int | None
) -> Backend:
    """Choose the backend of a rollout; problems of a sweep share a kernel."""
    problem = rollout.problem
    inputs = () if backend == "casadi" else swept_inputs(problem)
    if inputs:
        return shared_backend(problem, inputs, functions.nlp, exact, backend, threads)
    source = BackendSource(functions, lambda: rollout_program(rollout, exact), exact, program_identity(problem, exact))
    return choose(backend, source, threads)


def states_of(staged: Callable[[], StagedProblem] | None, guess: GuessedMotion | None) -> GuessedStates | None:
    """Return the states of a guessed motion, if there is one and the problem is staged."""
    if staged is None or guess is None:
        return None
    from symphys.transcription.staged.guessed_states import guessed_states

    return lambda z, ticks, smoothing: guessed_states(staged(), guess, z, ticks, smoothing)  # type: ignore[arg-type]


def guessed(made: Transcription, problem: Problem) -> Transcription:
    """Return ``made`` for a problem that differs only in its guess; compiled functions are shared."""
    states = states_of(made.shooting.staged, problem.guess)
    return replace(
        made, problem=problem, shooting=replace(made.shooting, blocks=blocks(problem), guessed_states=states)
    )
