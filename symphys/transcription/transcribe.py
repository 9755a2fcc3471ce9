"""From a problem to its transcription: the shooting problem that solvers see, with scenarios and sweeps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from math import exp, inf
from time import perf_counter
from typing import TYPE_CHECKING, Any, Protocol

import casadi as ca
import numpy as np

from symphys.codegen import Kernel, KernelUnavailable, ProgramError, processors
from symphys.codegen.backends import (
    BEST,
    PRECISIONS,
    Backend,
    BackendSource,
    Description,
    build_kernel,
    choose,
    described,
    require_backend,
)
from symphys.codegen.backends.interface import joined
from symphys.codegen.backends.simd import common, probed
from symphys.codegen.own_libraries import begin_own_libraries
from symphys.codegen.runtime.kernel import Outputs
from symphys.codegen.toolchain.warm_start import ProgramSource
from symphys.latest import Latest
from symphys.problem import GuessedMotion, Problem, Simulation, Variable
from symphys.shooting import (
    Evaluator,
    GuessedStates,
    LaterEvaluator,
    LaterNlp,
    Nlp,
    ScenarioSamples,
    ShootingProblem,
    StagedProblem,
    Values,
    WithoutResiduals,
)
from symphys.transcription.asking import asking
from symphys.transcription.decision_variables import blocks
from symphys.transcription.functions import ExpressionFunctions
from symphys.transcription.identities import program_identity, step_identity, swept_identity
from symphys.transcription.network_rollout import has_large_nets
from symphys.transcription.objective import bounds, has_squares, limits
from symphys.transcription.program import rollout_program
from symphys.transcription.rollout import Rollout, symbolic_rollout
from symphys.transcription.sampler import Sampler, swept_inputs
from symphys.transcription.staged.step_evaluator import StepEvaluator
from symphys.transcription.transcription import Transcription
from symphys.types import Array

if TYPE_CHECKING:
    from symphys.transcription.staged.linearization import Linearization
    from symphys.transcription.staged.linearized_step import LinearizedStep
    from symphys.transcription.staged.staged_problem import RolloutStages


def transcribe(
    problem: Problem,
    exact: bool = False,
    backend: str = BEST,
    threads: int | None = None,
) -> Transcription:
    """Transcribe a problem for solving, judging and recording.

    Args:
        problem: the problem to solve.
        exact: whether smoothing 0 is all that will be asked for; kernels then leave the smoothing out.
        backend: the evaluator, a name of ``symphys.codegen.backends.NAMES``.
        threads: their number for a batch; None: one for each processor.

    Example:
        >>> import symphys
        >>> from symphys.transcription import transcribe
        >>> made = transcribe(symphys.load("ball_throw"), backend="casadi")
        >>> made.judge(made.shooting.start(0)).solved, made.shooting.n
        (False, 6)
    """
    if problem.scenarios is not None:
        rest = replace(problem, scenarios=None)
        plain = transcribe(rest, exact, "casadi", threads)
        if not has_large_nets(problem):  # it is judged by kernels all the same
            plain = replace(plain, steps=cache(lambda: _steps(rest, backend, threads, exact)))
        return with_scenarios(plain, problem, exact, backend, threads)
    if has_large_nets(problem):
        return transcribe_large(problem, exact, backend, threads)
    return transcribe_whole(problem, exact, backend, threads)


def transcribe_finer(known: Transcription, simulation: Simulation) -> Transcription:
    """Transcribe a problem with another discretisation, to judge z there; equal steps are those of ``known``."""
    found = transcribe(replace(known.problem, simulation=simulation), backend="casadi")
    if has_large_nets(known.problem):
        return found
    if simulation.sweeps != known.problem.simulation.sweeps:  # another step, of which reports are asked for too
        found.simulate_by_reports()
    own, step = found.steps(), known.steps().step
    same = step_identity(own.rollout, own.step.exact)
    if same is None or same != step_identity(step.rollout, step.exact):
        return found
    shared = own.sharing(step)
    return replace(found, steps=lambda: shared)


def transcribe_whole(problem: Problem, exact: bool, backend: str, threads: int | None) -> Transcription:
    """Transcribe a problem without its scenarios as one expression; nets of any size are part of the step."""
    began = perf_counter()
    if backend in PRECISIONS:
        begin_own_libraries()
    rollout = symbolic_rollout(problem)
    functions = ExpressionFunctions(rollout)
    built = perf_counter() - began
    require_backend(backend)
    chosen = cache(lambda: _evaluating(rollout, functions, exact, backend, threads))
    steps = cache(lambda: _steps(problem, backend, threads, exact))
    staged = cache(lambda: _stages(steps(), backend, threads))
    shooting = replace(
        _shooting(problem, rollout, LaterEvaluator(lambda: chosen().evaluator), staged),
        nlp=LaterNlp(lambda: chosen().nlp),
        squares=has_squares(problem),
        by_steps=_by_steps(rollout, staged, backend),
    )
    return Transcription(problem, rollout, functions, shooting, lambda: chosen().description, built, steps)


def transcribe_large(problem: Problem, exact: bool, backend: str, threads: int | None) -> Transcription:
    """Transcribe a problem with large nets beside its steps; with fixed weights its steps may have them too."""
    from symphys.transcription.network_rollout import LargeTranscription, fits_step
    from symphys.transcription.network_rollout.context import make_context
    from symphys.transcription.network_rollout.transcription import evaluator_or_plain

    began = perf_counter()
    context = make_context(problem)
    built = perf_counter() - began
    evaluator, description = evaluator_or_plain(context, exact, backend, processors() if threads is None else threads)
    steps = cache(lambda: _steps(problem, backend, threads, exact))
    staged = cache(lambda: _stages(steps(), backend, threads)) if fits_step(problem) else None
    shooting = _shooting(problem, context.rollout, evaluator, staged)
    functions = ExpressionFunctions(context.rollout, context.objectives.terms)
    return LargeTranscription(
        problem, context.rollout, functions, shooting, lambda: description, built, steps, context=context
    )


def _shooting(
    problem: Problem, rollout: Rollout, evaluator: Evaluator, staged: Callable[[], RolloutStages] | None
) -> ShootingProblem:
    """Return what solvers see of a problem, without expressions and residuals."""
    names, lower, upper = bounds(rollout)
    missable = problem.targets or problem.constraints
    return ShootingProblem(
        name=problem.name,
        blocks=blocks(problem),
        evaluator=evaluator,
        nlp=Nlp(None),
        squares=False,
        constraint_names=names,
        constraint_lower=lower,
        constraint_upper=upper,
        limits=limits(problem),
        smoothing=problem.simulation.smoothing,
        stop_when_met=problem.stop_when_met,
        output_names=tuple(output.label for output in problem.outputs),
        staged=staged,
        asking=asking(staged) if staged is not None and missable else None,
        guessed_states=states_of(staged, problem.guess),
    )


def _steps(problem: Problem, backend: str, threads: int | None, exact: bool) -> Linearization:
    """Return motions and their derivatives step by step; compiled on demand, for any time step."""
    from symphys.transcription.staged.linearization import Linearization

    exact, rollout = exact or not any(problem.simulation.smoothing), symbolic_rollout(problem, timed=True)
    if not problem.varied or (identity := step_identity(rollout, exact)) is None:
        return Linearization(rollout, backend, threads, exact)
    key = (identity, backend, threads)
    if (step := LATEST_STEPS.get(key)) is not None:
        return Linearization(rollout, step=step)
    made = Linearization(rollout, backend, threads, exact)
    LATEST_STEPS.put(key, made.step)
    return made


def _stages(steps: Linearization, backend: str, threads: int | None) -> RolloutStages:
    """Return the staged problem, built on demand."""
    from symphys.transcription.staged.staged_problem import RolloutStages

    return RolloutStages(steps.rollout, backend, threads, steps.step.exact, linearization=steps)


def _by_steps(rollout: Rollout, staged: Callable[[], RolloutStages], backend: str) -> StepEvaluator | None:
    """Return the evaluator by steps; None for a backend that compiles no steps."""
    return StepEvaluator(rollout, staged) if backend != "c" else None


def _evaluating(
    rollout: Rollout, functions: ExpressionFunctions, exact: bool, backend: str, threads: int | None
) -> Backend:
    """Choose the backend of a rollout; problems of a sweep share a kernel."""
    problem = rollout.problem
    inputs = () if backend == "casadi" else swept_inputs(problem)
    if inputs:
        return shared_backend(problem, inputs, lambda: functions.nlp, exact, backend, threads)
    source = BackendSource(functions, lambda: rollout_program(rollout, exact), exact, program_identity(problem, exact))
    return choose(backend, source, threads)


def states_of(staged: Callable[[], StagedProblem] | None, guess: GuessedMotion | None) -> GuessedStates | None:
    """Return the states of a guessed motion, if there is one and the problem is staged."""
    if staged is None or guess is None:
        return None
    from symphys.transcription.staged.staged_problem import guessed_states

    return lambda z, ticks, smoothing: guessed_states(staged(), guess, z, ticks, smoothing)  # type: ignore[arg-type]


def guessed(made: Transcription, problem: Problem) -> Transcription:
    """Return ``made`` for a problem that differs only in its guess; compiled functions are shared."""
    states = states_of(made.shooting.staged, problem.guess)
    return replace(
        made, problem=problem, shooting=replace(made.shooting, blocks=blocks(problem), guessed_states=states)
    )


LATEST_STEPS: Latest[LinearizedStep] = Latest(3)
"""Steps of the last problems of a sweep, by everything that determines them: as they are, and as they are judged."""
LATEST_BACKEND: Latest[Backend] = Latest(1)
"""The backend of the last problem of a sweep, by everything that determines it."""


def shared_backend(
    problem: Problem,
    inputs: tuple[Variable, ...],
    nlp: Callable[[], Any],
    exact: bool,
    backend: str,
    threads: int | None,
) -> Backend:
    """Return the backend of a problem by a kernel that takes some of its numbers as inputs.

    A kernel has all other numbers of its problem as constants, and compiling takes longer than many a solve.
    Programs of problems that differ only in inputs are equal, and compiled once.

    Args:
        problem: of a sweep.
        inputs: see ``swept_inputs``.
        nlp: makes that of the problem itself, see ``Nlp.expression``.
        exact: as for ``transcribe``.
        backend: likewise.
        threads: likewise.
    """
    numbers = np.concatenate([variable.guess for variable in inputs])
    rollout = symbolic_rollout(replace(problem, variables=(*problem.variables, *inputs)))
    identity = swept_identity(rollout, inputs, exact)
    key = (identity, backend, threads)
    if identity is not None and (known := LATEST_BACKEND.get(key)) is not None:
        made = known.description
        chosen = replace(known, description=replace(made, seconds=0.0, cached=None if made.cached is None else True))
    else:
        source = BackendSource(ExpressionFunctions(rollout), lambda: rollout_program(rollout, exact), exact, identity)
        chosen = LATEST_BACKEND.put(key, choose(backend, source, threads))
    bound = LaterNlp(lambda: bound_nlp(chosen.nlp, nlp(), numbers))
    return replace(chosen, evaluator=BoundEvaluator(chosen.evaluator, numbers), nlp=bound)


class BoundEvaluator:
    """An ``Evaluator`` that appends the same numbers to every point."""

    def __init__(self, evaluator: Evaluator, numbers: Array) -> None:
        """Append ``numbers`` (s,) to z."""
        self.evaluator, self.numbers = evaluator, numbers

    def value(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.value``."""
        return self.evaluator.value(self.joined(Z), smoothing)

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.gradient``."""
        return self.cut(self.evaluator.gradient(self.joined(Z), smoothing))

    def residuals(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.residuals``."""
        return self.evaluator.residuals(self.joined(Z), smoothing)

    def jacobian(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.jacobian``."""
        return self.cut(self.evaluator.jacobian(self.joined(Z), smoothing))

    def joined(self, Z: Array) -> Array:
        """Return points (batch, n + s)."""
        return np.hstack([Z, np.broadcast_to(self.numbers, (len(Z), self.numbers.size))])

    def cut(self, found: Values) -> Values:
        """Return the values with derivatives by z alone."""
        count = self.numbers.size
        slopes = {name: getattr(found, name) for name in ("gradient", "jacobian")}
        return replace(
            found, **{name: np.ascontiguousarray(d[..., :-count]) for name, d in slopes.items() if d is not None}
        )


def bound_nlp(shared: Nlp, expression: Any, numbers: Array) -> Nlp:
    """Return objective and constraints with these numbers after z; ``expression``: of the problem itself."""
    if shared.value is None:
        return Nlp(expression)
    z, smoothing = ca.MX.sym("z", expression.size1_in(0)), ca.MX.sym("smoothing")
    joined, count = ca.vertcat(z, ca.DM(numbers)), expression.size1_in(0)

    def bound(name: str, function: Any, columns: bool | None) -> Any:
        if function is None:
            return None
        first, second = function(joined, smoothing)
        if columns is not None:
            second = second[:, :count] if columns else second[:count]
        return ca.Function(name, [z, smoothing], [first, second])

    return Nlp(
        expression,
        bound("value", shared.value, None),
        bound("gradient", shared.gradient, False),
        bound("jacobian", shared.jacobian, True),
        keep=shared.keep,
    )


class SampleEvaluator(Protocol):
    """Evaluates rows (B, n + s): points followed by the numbers of a sample."""

    def sample_values(self, rows: Array, smoothing: float) -> Values:
        """Return values without gradients."""
        ...

    def sample_gradients(self, rows: Array, smoothing: float, discount: float, skipped: int) -> Values:
        """Return values with gradients (B, n + s).

        Args:
            rows: see above.
            smoothing: [m/s].
            discount: share of its adjoint that the state loses in each step back, see ``AdjointDiscount``.
            skipped: steps at the end that are not computed.
        """
        ...


class KernelSamples:
    """A ``SampleEvaluator`` by a kernel."""

    def __init__(self, kernel: Kernel) -> None:
        """Wrap a kernel of the sampler's problem whose merit is seeded."""
        self.kernel = kernel

    def sample_values(self, rows: Array, smoothing: float) -> Values:
        """Implement ``SampleEvaluator.sample_values``."""
        outputs = self.kernel.forward(rows, [smoothing])
        return replace(values(outputs), probe=probed(self.kernel, outputs))

    def sample_gradients(self, rows: Array, smoothing: float, discount: float, skipped: int) -> Values:
        """Implement ``SampleEvaluator.sample_gradients``."""
        outputs, slopes = self.kernel.gradient(rows, [1.0], [smoothing], discount, skipped)
        return values(outputs, slopes)


class ScenarioGrids:
    """A ``ScenarioEvaluator``: a sampler and an evaluator for each time grid."""

    def __init__(
        self, grids: Sequence[str], samplers: Sequence[Sampler], evaluators: Sequence[SampleEvaluator]
    ) -> None:
        """Combine the samplers and evaluators of grids, which have names."""
        self.grids, self.samplers, self.evaluators = tuple(grids), tuple(samplers), tuple(evaluators)

    def draw(self, rng: np.random.Generator, count: int, width: float = 1.0, grid: int = 0) -> ScenarioSamples:
        """Implement ``ScenarioEvaluator.draw``."""
        return ScenarioSamples(grid, self.samplers[grid].draw(rng, count, width))

    def nominal(self, count: int) -> ScenarioSamples:
        """Return the nominal sample, ``count`` times."""
        return ScenarioSamples(0, np.tile(self.samplers[0].nominal, (count, 1)))

    def value(self, Z: Array, drawn: ScenarioSamples, smoothing: float) -> Values:
        """Implement ``ScenarioEvaluator.value``."""
        return self.evaluators[drawn.grid].sample_values(_joined(Z, drawn), smoothing)

    def gradient(
        self, Z: Array, drawn: ScenarioSamples, smoothing: float, adjoint_discount: float = 0.0, horizon: float = inf
    ) -> Values:
        """Implement ``ScenarioEvaluator.gradient``."""
        simulation = self.samplers[drawn.grid].problem.simulation
        discount = 1 - exp(-adjoint_discount * simulation.dt)
        skipped = max(0, simulation.steps - round(min(horizon, simulation.duration) / simulation.dt))
        found = self.evaluators[drawn.grid].sample_gradients(_joined(Z, drawn), smoothing, discount, skipped)
        assert found.gradient is not None, "gradients were asked for"
        return replace(found, gradient=np.ascontiguousarray(found.gradient[:, : Z.shape[1]]))


class NominalEvaluator(WithoutResiduals):
    """An ``Evaluator`` in the nominal sample."""

    def __init__(self, scenario: ScenarioGrids) -> None:
        """Wrap an evaluator of samples."""
        self.scenario = scenario

    def value(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.value``."""
        return self.scenario.value(Z, self.scenario.nominal(len(Z)), smoothing)

    def gradient(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.gradient``."""
        return self.scenario.gradient(Z, self.scenario.nominal(len(Z)), smoothing)


def _joined(Z: Array, drawn: ScenarioSamples) -> Array:
    """Return rows (batch, n + s)."""
    return np.hstack([np.broadcast_to(Z, (len(drawn.numbers), Z.shape[1])), drawn.numbers])


def values(outputs: Outputs, gradient: Array | None = None) -> Values:
    """Read the outputs of a kernel."""
    alive = outputs["alive"][:, 0] if "alive" in outputs else None
    return Values(*common(outputs), gradient=gradient, alive=alive)


NO_SAMPLES = "there are no samples of scenarios"


def with_scenarios(
    plain: Transcription, problem: Problem, exact: bool, backend: str, threads: int | None
) -> Transcription:
    """Return ``plain``, transcribed without scenarios, with kernels of the scenarios as its backend.

    Where there can be no kernels it stays as it is, and its backend's note says so.
    """
    began, count = perf_counter(), processors() if threads is None else threads
    assert problem.scenarios is not None, "nothing differs"
    grids = {"": problem.simulation, **{grid.name: grid.simulation for grid in problem.scenarios.discretisations}}
    try:
        if backend not in PRECISIONS:
            raise KernelUnavailable(f"the backend {backend} cannot draw samples of scenarios")
        samplers = [Sampler(replace(problem, simulation=simulation)) for simulation in grids.values()]
        made = [_sample_evaluator(each.problem, exact, backend, count) for each in samplers]
    except (KernelUnavailable, ProgramError) as error:
        description = replace(plain.backend, note=f"{NO_SAMPLES}: {error}")
        return replace(plain, problem=problem, described=lambda: description)
    scenario = ScenarioGrids(list(grids), samplers, [evaluator for evaluator, _ in made])
    shooting = replace(
        plain.shooting,
        evaluator=NominalEvaluator(scenario),
        scenario=scenario,
        squares=False,
        nlp=Nlp(None),
        by_steps=None,
    )
    note = joined(made[0][1].note, f"{len(grids)} discretisations" if len(grids) > 1 else "")
    cached = all(description.cached for _, description in made)
    description = replace(made[0][1], seconds=perf_counter() - began, note=note, cached=cached)
    return replace(plain, problem=problem, shooting=shooting, described=lambda: description)


def _sample_evaluator(problem: Problem, exact: bool, backend: str, threads: int) -> tuple[SampleEvaluator, Description]:
    """Build the evaluator of one grid: a kernel, or a kernel for steps with large nets between them."""
    if has_large_nets(problem):
        from symphys.transcription.network_rollout.context import make_context
        from symphys.transcription.network_rollout.transcription import large_evaluator

        return large_evaluator(make_context(problem), exact, backend, threads)
    source = ProgramSource(lambda: rollout_program(symbolic_rollout(problem), exact), program_identity(problem, exact))
    kernel = build_kernel(backend, source, ("merit",), threads)
    return KernelSamples(kernel), described(kernel, 0.0)
