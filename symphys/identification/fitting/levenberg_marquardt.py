"""Levenberg-Marquardt over all recordings at once, within bounds, on the arrow of shared and own numbers.

The merit is sum rho(r) over all residuals and priors. Each step solves (H + lambda I) d = -g in scaled numbers over
those that are free: a number at a bound that the gradient pushes against is held (active set), and the step is
projected into the bounds. lambda follows the gain ratio (Nielsen 1999; Madsen, Nielsen, Tingleff 2004, algorithm 3.16).
A trial of which a recording's simulation is not finite is refused, like one that raises the merit.

The fit has converged where the step that is left, undamped, is below ``tolerance`` standard errors: its expected fall
of the merit is below tolerance^2 times the merit per residual. That needs no unit and no scale. Where steps bring
nothing any more, directions that the recordings leave vague have no part in it (``remaining``), and where they are
refused, the Jacobians of both sides of a kink say whether any direction lowers the merit (``kinks``).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from symphys.identification.fitting.arrow import ArrowSystem, assemble, costs
from symphys.identification.fitting.kinks import KinkedModel
from symphys.identification.fitting.remaining import DeterminedArrow, number_units
from symphys.identification.fitting.state import FitOptions, FitOutcome, FitState, FitStatus, FitStep, begin
from symphys.identification.interface import FitParameters, IdentificationError, RecordedResiduals
from symphys.types import Array, Bools, Ints

LOOSEST = 1 / 3
"""lambda falls at most to this share after a step that went as foreseen."""
WORTH = 1e-4
"""A step is taken if the merit falls by more than this share of what the model expects."""
STIFFEST = 1e20
"""lambda over the largest diagonal of the first blocks: beyond it a step is no step."""
EXACT = 1e-16
"""Merit per residual below which recordings are met exactly: residuals of 1e-8 of the noise."""
ROUNDING = 1e-14
"""A fall of the merit by this share of itself cannot be told from rounding."""
PROGRESS = 1e-2
"""A fall of the merit by this share of itself per residual is progress: that of a tenth of a standard error."""
HOPELESS = 1e-2
"""Of the fall that the model promises: where so many steps as patience lasts bring less, it is another merit."""
WORTH_AT_KINK = 0.1
"""The same where the sides of a kink are collected: a step that gains less shows one more side."""
AT_KINK = 1e-2
"""Standard errors: sides are collected where more are left, and a kink is a minimum where they promise no more. At most
as many are left as noise makes, the root of how many numbers there are: more is another minimum, or chaos."""
NEAR = 0.1
"""Standard errors that may be left where the merit does not fall any more: intervals are no narrower than that."""
SHORTER = (1e-4, 1e-2, 1.0, 1e2, 1e6)
"""Damping of own numbers, by the largest diagonal of a recording, where the whole step makes that recording worse."""
MODELLED = 0.05
"""Share of its cost by which a recording may end above its model."""
MOST_SIDES = 8
"""Points whose Jacobians are collected in an iteration."""
EXACTLY = "the recordings are met exactly"
BUDGET = "the iterations are used up: raise `iterations`"
STOPPED = "interrupted: the state goes on from here"
LEFT = "{left:.1g} standard errors are left"
VAGUELY = (
    "{left:.1g} standard errors are left, without {names}, which the recordings do not determine: there the Jacobian "
    "puts the minimum {far:.2g} standard errors away, where it no longer holds"
)
KINK = (
    "the merit has a kink here, as where an impact falls on a sample; both sides together leave {left:.1g} standard "
    "errors. The Jacobian of one side alone puts the minimum {far:.2g} standard errors away: the intervals reach there"
)
NEARLY = "the merit does not fall any more, and the Jacobian puts its minimum {left:.2g} standard errors away"
STALLED = (
    "no lower merit was found although the Jacobian promises one, {left:.2g} standard errors away: the merit may have "
    "a kink there (impacts that begin or end within a recording), or the Jacobian is wrong"
)
SLOW = "the merit hardly falls any more; the Jacobian puts its minimum {left:.2g} standard errors away"
START = "the simulation of {names} is not finite at the guess: look at its start, or bound the numbers"
TRIALS = "the simulation of {names} is not finite at any step from the best point: bound the numbers"


Step = tuple[Array, Array]
"""Of the shared (s,) and the own (k, o) numbers, in scales."""


class RecordingFit:
    """Levenberg-Marquardt on some recordings of a problem."""

    def __init__(
        self,
        problem: RecordedResiduals,
        options: FitOptions,
        which: Ints | None = None,
        weights: Array | None = None,
        hold_shared: bool = False,
    ) -> None:
        """``which`` are fitted, those not held back by default; their costs count ``weights`` (K,) times."""
        self.problem, self.options, self.loss = problem, options, options.loss
        self.which = np.flatnonzero(~problem.held_back) if which is None else which
        if not self.which.size:
            raise IdentificationError("no recording is left to fit to: all are held back")
        self.weights = np.ones(len(self.which)) if weights is None else weights
        self.hold_shared, self.simulations, self.jacobians = hold_shared, 0, 0
        self.size = max(1, sum(len(problem.rows(int(k)).time) for k in self.which))

    def run(
        self,
        start: FitState | None = None,
        monitor: Callable[[FitStep, FitState], None] | None = None,
        stop: Callable[[], bool] | None = None,
    ) -> FitOutcome:
        """Fit from the guess, or go on from ``start``; ``stop`` is asked and ``monitor`` told after each iteration."""
        began = time.perf_counter()
        state = start or begin(self.problem.shared.guess, self.problem.own.guess)
        system = self.system(state.shared, state.own)
        if not system.finite:
            return FitOutcome(FitStatus.NOT_FINITE, START.format(names=self._names(system.costs)), state, system)
        if state.history:  # the work of the start is in its history
            last = state.history[-1]
            self.simulations, self.jacobians, began = last.simulations, last.jacobians, began - last.seconds
        if math.isnan(state.damping):
            state = self._first(state, system, began)
            if monitor:
                monitor(state.history[-1], state)
        while True:
            ended = self._ended(state, system)
            if ended is None and stop is not None and stop():
                ended = (FitStatus.INTERRUPTED, STOPPED)
            found = ended or self._step(state, system, began)
            if isinstance(found[0], FitStatus):
                return FitOutcome(found[0], found[1], state, system, *found[2:])
            state, system = found
            if monitor:
                monitor(state.history[-1], state)

    def system(self, shared: Array, own: Array) -> ArrowSystem:
        """The arrow at shared (s,) and own (K, o) numbers, of the recordings that are fitted."""
        self.jacobians += len(self.which)
        evaluated = self.problem.jacobian(shared, own, self.which)
        return assemble(self.problem, evaluated, shared, own, self.which, self.loss, self.weights)

    def _first(self, begun: FitState, system: ArrowSystem, began: float) -> FitState:
        """The first iteration sets lambda."""
        diagonals = np.diagonal(system.blocks, axis1=1, axis2=2)
        size = float(np.max(diagonals, initial=0.0)) or 1.0
        state = replace(begun, damping=self.options.damping * size, stiffest=STIFFEST * size, mark=system.cost)
        state = replace(state, first=len(state.history))
        return self._recorded(state, system, 0.0, began)

    def _recorded(self, state: FitState, system: ArrowSystem, step: float, began: float) -> FitState:
        """The state with a row of its history."""
        row = FitStep(
            iteration=len(state.history),
            merit=system.cost,
            left=self.left(state, system),
            damping=state.damping,
            step=step,
            simulations=self.simulations,
            jacobians=self.jacobians,
            seconds=time.perf_counter() - began,
        )
        return replace(state, history=(*state.history, row))

    def free(self, state: FitState, system: ArrowSystem) -> tuple[Bools, Bools]:
        """(s,) and (k, o) of the recordings that are fitted: False where a bound holds a number."""
        shared = movable(self.problem.shared, state.shared, system.shared_gradient)
        own = movable(self.problem.own, state.own, system.own_gradient, self.which)
        return shared & (not self.hold_shared), own

    def left(self, state: FitState, system: ArrowSystem) -> float:
        """Standard errors between the state and where its quadratic model has the minimum."""
        return self._errors(system.expected_fall(*system.step(0.0, *self.free(state, system))), system)

    def _ended(self, state: FitState, system: ArrowSystem) -> tuple[FitStatus, str] | None:
        last = state.history[-1]
        if system.cost <= EXACT * self.size:
            return FitStatus.CONVERGED, EXACTLY
        if last.left <= self.options.tolerance:
            return FitStatus.CONVERGED, LEFT.format(left=last.left)
        if state.quiet and not (arrow := self._arrow(state, system)).whole:
            left = self._errors(system.expected_fall(*arrow.step()), system)
            if left <= self.options.tolerance:
                return FitStatus.CONVERGED, VAGUELY.format(left=left, names=self._vague(arrow), far=last.left)
        if last.iteration - state.first >= self.options.iterations:
            return FitStatus.BUDGET, BUDGET
        if state.quiet >= (self.options.patience or math.inf):
            return self._stalled(SLOW, last.left)
        if self._hopeless(state, last.left):
            left = self._errors(system.expected_fall(*self._arrow(state, system).step()), system)
            if self._hopeless(state, left):
                return self._stalled(SLOW, left)
        return None

    def _hopeless(self, state: FitState, left: float) -> bool:
        """Whether the last steps have brought next to nothing of the fall that goes with so many standard errors."""
        patience, last = self.options.patience, state.history[-1]
        if not patience or last.iteration - state.first < patience:
            return False
        return state.history[-1 - patience].merit - last.merit < HOPELESS * left**2 * last.merit / self.size

    def _arrow(self, state: FitState, system: ArrowSystem, damping: float = 0.0) -> DeterminedArrow:
        """Without what is vague at the state."""
        numbers = (self.problem.shared, self.problem.own), (state.shared, state.own)
        return DeterminedArrow(system, number_units(*numbers, self.free(state, system), self.which), damping)

    def _errors(self, fall: float, system: ArrowSystem) -> float:
        """A fall of the merit in standard errors."""
        return math.sqrt(max(0.0, fall) * self.size / system.cost) if system.cost > 0 else 0.0

    def _step(
        self, state: FitState, system: ArrowSystem, began: float
    ) -> tuple[FitState, ArrowSystem] | tuple[FitStatus, str] | tuple[FitStatus, str, Array]:
        """One step that lowers the merit, and the system there; lambda grows until there is one.

        Else how the fit ended, and at a kink how far from the shared numbers (s,) one side has its minimum.
        """
        refused, merit, left, kinked = "", system.cost, state.history[-1].left, False
        near = left <= math.sqrt(sum(int(each.sum()) for each in self.free(state, system)))
        kink = near and left > AT_KINK
        model = KinkedModel(system, merit / self.size)
        while state.damping <= state.stiffest:
            shared, own, taken, length = self._moved(state, *self._direction(state, model, kinked))
            recordings, priors = costs(self.problem, shared, own, self.which, self.loss, self.weights)
            self.simulations += len(self.which)
            if not near:
                own, taken, recordings = self._retried(state, system, shared, own, taken, recordings)
            trial, expected = float(recordings.sum()) + priors, model.expected_fall(*taken)
            gain = (merit - trial) / expected if expected > 0 and math.isfinite(trial) else -math.inf
            refused = "" if math.isfinite(trial) else self._names(recordings)
            better = gain > (WORTH_AT_KINK if kinked else WORTH)
            if better or (kinked and not refused):
                there = self.system(shared, own)
                if not there.finite:
                    refused = self._names(there.costs)
                elif better:
                    return self._accept(state, there, shared, own, length, gain, began), there
                else:
                    model.add(there, *taken)
                    arrow = self._arrow(state, system)
                    open_ = self._errors(model.step(arrow)[2], system)
                    if open_ <= max(AT_KINK, self.options.tolerance):
                        away = arrow.step()[0] * self.problem.shared.scale
                        return FitStatus.CONVERGED, KINK.format(left=open_, far=left), away
                    if model.sides <= MOST_SIDES:
                        continue
                    kink, model = False, KinkedModel(system, merit / self.size)
            kinked = kink
            state = replace(state, damping=state.damping * state.growth, growth=2 * state.growth)
        if refused:
            return FitStatus.NOT_FINITE, TRIALS.format(names=refused)
        if left <= math.sqrt(ROUNDING * self.size):
            return FitStatus.CONVERGED, LEFT.format(left=left) + ", which the merit's last digits do not show"
        return self._stalled(STALLED, left)

    def _retried(
        self, state: FitState, system: ArrowSystem, shared: Array, own: Array, taken: Step, reached: Array
    ) -> tuple[Array, Step, Array]:
        """Own numbers, step and costs (k,), with shorter steps of recordings that the whole step made worse.

        Own numbers of a recording have no effect on others, so that one that leaves its model need not hold up all.
        """
        free, d_shared = self.free(state, system)[1], taken[0]
        stiff = np.einsum("kii->ki", system.blocks[:, system.s :, system.s :]).max(axis=1, initial=0.0)
        own, best = own.copy(), reached.copy()
        for share in SHORTER:
            excess = best - system.costs + system.expected_falls(d_shared, self._step_of(state, own))
            off = ~(excess <= MODELLED * np.maximum(system.costs, best)) | ((best > system.costs) & (excess > 0))
            some = np.flatnonzero(off)
            if not some.size or not system.blocks.shape[1] > system.s:
                break
            steps = system.own_step(d_shared, state.damping + share * stiff, free)
            tried = self._moved(state, d_shared, steps)[1]
            trial = own.copy()
            trial[self.which[some]] = tried[self.which[some]]
            found, _ = costs(self.problem, shared, trial, self.which[some], self.loss, self.weights[some])
            self.simulations += len(some)
            lower = some[found < best[some]]
            own[self.which[lower]] = trial[self.which[lower]]
            best[lower] = found[np.isin(some, lower)]
        return own, (d_shared, self._step_of(state, own)), best

    def _step_of(self, state: FitState, own: Array) -> Array:
        """(k, o): the step to own numbers (K, o), in scales."""
        return np.asarray(((own - state.own) / self.problem.own.scale)[self.which])

    def _direction(self, state: FitState, model: KinkedModel, kinked: bool) -> tuple[Array, Array]:
        """The next step (s,) and (k, o) in scales: by the sides of a kink, without what is vague, or damped."""
        if kinked:
            return model.step(self._arrow(state, model.system, state.damping))[:2]
        if state.quiet and not (arrow := self._arrow(state, model.system)).whole:
            return arrow.step()
        return model.system.step(state.damping, *self.free(state, model.system))

    @staticmethod
    def _stalled(reason: str, left: float) -> tuple[FitStatus, str]:
        """Near the minimum of the model that is as good as there."""
        if left <= NEAR:
            return FitStatus.CONVERGED, NEARLY.format(left=left)
        return FitStatus.STALLED, reason.format(left=left)

    def _moved(self, state: FitState, d_shared: Array, d_own: Array) -> tuple[Array, Array, Step, float]:
        """The next shared and own numbers after a step in scales within the bounds, the step taken, and its length."""
        shared_of, own_of, which = self.problem.shared, self.problem.own, self.which
        shared = np.clip(state.shared + shared_of.scale * d_shared, shared_of.lower, shared_of.upper)
        own = state.own.copy()
        own[which] += own_of.scale[which] * d_own
        own = np.clip(own, own_of.lower, own_of.upper)
        taken = (shared - state.shared) / shared_of.scale, self._step_of(state, own)
        length = math.sqrt(float(np.sum(taken[0] ** 2) + np.sum(taken[1] ** 2)))
        return shared, own, taken, length

    def _accept(
        self, state: FitState, system: ArrowSystem, shared: Array, own: Array, step: float, gain: float, began: float
    ) -> FitState:
        """The state after a step; lambda falls with the gain ratio."""
        damping = state.damping * max(LOOSEST, 1 - (2 * gain - 1) ** 3)
        fell = system.cost < state.mark * (1 - PROGRESS / self.size)
        mark, quiet = (system.cost, 0) if fell else (state.mark, state.quiet + 1)
        taken = replace(state, shared=shared, own=own, damping=damping, growth=2.0, mark=mark, quiet=quiet)
        return self._recorded(taken, system, step, began)

    def _vague(self, arrow: DeterminedArrow) -> str:
        """Numbers that take part in a direction that is not determined."""
        shared = [name for name, vague in zip(self.problem.shared.names, arrow.vague_shared, strict=True) if vague]
        counts = zip(self.problem.own.names, arrow.vague_own.sum(axis=0), strict=True)
        return ", ".join([*shared, *(f"{name} of {count} recordings" for name, count in counts if count)])

    def _names(self, recordings: Array) -> str:
        """Of those whose costs are not finite."""
        bad = [
            self.problem.recordings[k] for k, cost in zip(self.which, recordings, strict=True) if not np.isfinite(cost)
        ]
        return ", ".join(bad[:3]) + (f" and {len(bad) - 3} more" if len(bad) > 3 else "")


def movable(parameters: FitParameters, values: Array, gradient: Array, which: Ints | None = None) -> Bools:
    """False for a number at a bound that the gradient pushes against, and for one whose bounds are equal."""
    some = slice(None) if which is None else which
    at, lower, upper = values[some], parameters.lower[some], parameters.upper[some]
    against = ((at <= lower) & (gradient > 0)) | ((at >= upper) & (gradient < 0))
    return np.asarray(~against & (lower < upper))
