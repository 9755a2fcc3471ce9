"""The fit of all recordings by Levenberg-Marquardt on the arrow matrix of shared and own numbers.

The merit is sum rho(r) over all residuals and priors, in scaled numbers. The loop, the damping and the active set are
those of ``solvers.core.levenberg_marquardt``; the linear system is solved by a Schur complement over recordings
(``arrow``). A trial of which a recording's simulation is not finite is refused, like one that raises the merit.

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
from typing import NamedTuple

import numpy as np
import scipy.optimize

from symphys.identification.fitting.arrow import ArrowSystem, assemble, costs
from symphys.identification.fitting.remaining import DeterminedArrow, number_units
from symphys.identification.fitting.state import FitOptions, FitOutcome, FitState, FitStatus, FitStep, begin
from symphys.identification.interface import FitParameters, IdentificationError, RecordedResiduals
from symphys.solvers.core.convergence import Progress
from symphys.solvers.core.levenberg_marquardt import (
    MIN_GAIN_RATIO,
    LocalModel,
    Refusal,
    Trial,
    descend,
    first_damping,
    movable,
)
from symphys.types import Array, Bools, Ints

MAX_WEIGHTED_SIDES = 200
"""Largest number of sides of single recordings in a step; the most different ones are taken."""
SUM_WEIGHT = 1e4
"""Weight of the equations that make the shares of a recording sum to 1."""
RELATIVE_RIDGE = 1e-12
"""Share of its largest diagonal that is added to the quadratic program."""


class KinkedModel:
    """The model of the merit about a point with the known sides of a kink.

    An impact that falls on a sample gives the merit a kink: one side has the velocity before the impact, the other that
    after it. The Jacobian of one side then predicts a decrease across the kink that is not there. A bundle method
    (Lemaréchal 1978; Kiwiel 1985) collects the Jacobians of points where a step was refused. The cost of recording k
    about a point x is

        f_k(x + d) = f_k(x) + max_p (2 g_kp d - e_kp) + d H_k d,

    with p the sides, g_kp half the gradient that side p has at x, and e_kp the difference of its cost from f_k(x)
    there. The dual of the step is a quadratic program in the shares of the sides, one simplex for each recording.
    Where it predicts no decrease, no direction lowers the merit: the point is a minimum at the kink (Clarke 1983).
    Sides that do not fit together have a large e_kp, so that a wrong Jacobian or a cliff does not pass for a kink.

    Attributes:
        system: the arrow at the point.
        gradients: (P, K, n) of the sides at the point, in scales; the first is the arrow's own.
        gaps: (P, K) how far the costs of the sides are from those at the point.
        unit: the merit per residual: the fall of a standard error.
    """

    def __init__(self, system: ArrowSystem, unit: float) -> None:
        """Start with the side of the arrow."""
        self.system, self.unit = system, unit
        self.gradients, self.gaps = system.gradients[None], np.zeros((1, len(system.costs)))

    @property
    def sides(self) -> int:
        """Return the number of known sides."""
        return len(self.gaps)

    def add(self, there: ArrowSystem, shared: Array, own: Array) -> None:
        """Add the side of a point at the step (s,), (K, o)."""
        step = np.concatenate([np.broadcast_to(shared, (len(own), len(shared))), own], axis=1)
        bent = np.einsum("kij,kj->ki", there.blocks, step)
        costs = there.costs - 2 * np.sum(there.gradients * step, axis=1) + np.sum(bent * step, axis=1)
        self.gradients = np.concatenate([self.gradients, (there.gradients - bent)[None]])
        self.gaps = np.concatenate([self.gaps, np.abs(self.system.costs - costs)[None]])

    def expected_fall(self, shared: Array, own: Array) -> float:
        """Return the decrease of the merit predicted for a step (s,), (K, o)."""
        step = np.concatenate([np.broadcast_to(shared, (len(own), len(shared))), own], axis=1)
        more = 2 * np.sum((self.gradients - self.gradients[0]) * step, axis=2) - self.gaps
        return self.system.expected_fall(shared, own) - float(np.sum(np.max(more, axis=0)))

    def step(self, arrow: DeterminedArrow) -> tuple[Array, Array, float]:
        """Compute the step (s,), (K, o) in scales, and the predicted decrease."""
        s, base = self.system.s, self.system.gradients
        taken, sides = self._taken(arrow)
        prior = self.system.prior_gradient * arrow.units[0, :s]
        scaled = self.gradients[..., s:] * arrow.units[:, s:]
        combined, gap = base.copy(), 0.0
        if len(taken):
            shares = self._shares(arrow, taken, sides, scaled, prior)
            k, p = taken.T
            for recording in np.unique(k):
                mine = k == recording
                combined[recording] = np.einsum("p,pn->n", shares[mine], self.gradients[p[mine], recording])
            gap = float(shares @ self.gaps[p, k])
        side = arrow.sides(combined).sum(axis=0) + prior
        own = combined[:, s:] * arrow.units[:, s:]
        fall = float(side @ arrow.shared_inverse @ side) + float(np.einsum("ka,kab,kb->", own, arrow.own_inverse, own))
        return *arrow.step(combined), fall + gap

    def _taken(self, arrow: DeterminedArrow) -> tuple[Ints, Array]:
        """Return (N, 2) recordings and sides in the step, and (P, K, s) the right sides of all."""
        s, sides = self.system.s, arrow.sides(self.gradients)
        off, own = sides - sides[0], (self.gradients - self.gradients[0])[..., s:] * arrow.units[:, s:]
        apart = np.einsum("pks,st,pkt->pk", off, arrow.shared_inverse, off)
        apart += np.einsum("pka,kab,pkb->pk", own, arrow.own_inverse, own)
        least = max(np.sort(apart, axis=None)[-min(MAX_WEIGHTED_SIDES, apart.size)], 1e-12 * self.unit)
        chosen: Bools = (apart >= least) & (apart > 0)
        chosen[0] = chosen.any(axis=0)
        p, k = np.nonzero(chosen)
        return np.stack([k, p], axis=1), sides

    def _shares(self, arrow: DeterminedArrow, taken: Ints, sides: Array, own: Array, prior: Array) -> Array:
        """Return (N,) shares of the sides ``taken``, at least 0, that sum to 1 for each recording."""
        k, p = taken.T
        mine, same = sides[p, k], k[:, None] == k
        alone = np.setdiff1d(np.arange(len(self.system.costs)), k)
        rest = prior + sides[0, alone].sum(axis=0)
        gained = np.einsum("iab,ib->ia", arrow.own_inverse[k], own[p, k])
        square = (mine @ arrow.shared_inverse @ mine.T + same * (own[p, k] @ gained.T)) / self.unit
        linear = (2 * mine @ arrow.shared_inverse @ rest + self.gaps[p, k]) / self.unit
        values, vectors = np.linalg.eigh(square)
        root = np.sqrt(np.maximum(values, 0) + RELATIVE_RIDGE * max(values[-1], 1e-300))
        weight = SUM_WEIGHT * root[-1]
        together = (np.unique(k)[:, None] == k) * weight
        rows = np.concatenate([root[:, None] * vectors.T, together])
        right = np.concatenate([-(vectors.T @ linear) / (2 * root), np.full(len(together), weight)])
        shares, _ = scipy.optimize.nnls(rows, right)
        sums = np.bincount(k, shares)[k]
        return np.asarray(np.where(sums > 0, shares / np.where(sums > 0, sums, 1.0), (p == 0).astype(float)))


EXACT_MERIT = 1e-16
"""Merit per residual below which the fit is exact: residuals of 1e-8 of the noise."""
RELATIVE_ROUNDING = 1e-14
"""Relative decrease of the merit that cannot be distinguished from rounding."""
MIN_PROGRESS = 1e-2
"""Relative decrease of the merit per residual that is progress: a tenth of a standard error."""
MIN_SHARE_OF_MODEL = 1e-2
"""Share of the predicted decrease below which, over ``patience`` steps, the model is wrong."""
MIN_GAIN_AT_KINK = 0.1
"""``MIN_GAIN_RATIO`` while the sides of a kink are collected: a step with less gain adds one more side."""
KINK_ERRORS = 1e-2
"""Standard errors to the minimum above which sides of a kink are collected; below it the kink counts as a minimum.

Noise explains at most the square root of the number of numbers: a larger distance is another minimum, or chaos.
"""
NEARLY_CONVERGED_ERRORS = 0.1
"""Standard errors that may remain at a stalled fit: intervals are no narrower than that."""
RETRY_DAMPINGS = (1e-4, 1e-2, 1.0, 1e2, 1e6)
"""Damping of own numbers, by the largest diagonal of a recording, where the whole step makes that recording worse."""
MAX_MODEL_EXCESS = 0.05
"""Relative excess of a recording's cost over its model that needs no retry."""
MAX_SIDES = 8
"""Largest number of points whose Jacobians are collected in an iteration."""
EXACTLY = "the recordings are met exactly"
BUDGET = "the iterations are used up: raise `iterations`"
STOPPED = "interrupted: the state goes on from here"
LEFT = "the remaining step is {left:.1g} standard errors"
VAGUELY = (
    "the remaining step is {left:.1g} standard errors, excluding {names}, which the recordings do not determine (the "
    "Jacobian predicts their minimum {far:.2g} standard errors away, outside its range of validity)"
)
KINK = (
    "the objective has a kink here, for example because an impact falls on a sample; with both sides the remaining "
    "step is {left:.1g} standard errors. The Jacobian of one side predicts the minimum {far:.2g} standard errors "
    "away: the intervals reach that far"
)
NEARLY = "the objective does not decrease further; the Jacobian predicts its minimum {left:.2g} standard errors away"
STALLED = (
    "no step lowers the objective, although the Jacobian predicts a minimum {left:.2g} standard errors away: the "
    "objective may have a kink (impacts that begin or end within a recording), or the Jacobian is wrong"
)
SLOW = "the objective hardly decreases; the Jacobian predicts its minimum {left:.2g} standard errors away"
START = "the simulation of {names} is not finite at the guess: look at its start, or bound the numbers"
TRIALS = "the simulation of {names} is not finite at any step from the best point: bound the numbers"


Step = tuple[Array, Array]
"""Step of the shared (s,) and the own (k, o) numbers, in scales."""


class Moved(NamedTuple):
    """The numbers after a step within the bounds.

    Attributes:
        shared, own: (s,) and (K, o).
        taken: the step.
        length: of the whole step, in scales.
    """

    shared: Array
    own: Array
    taken: Step
    length: float


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
        """Fit ``which``, by default all that are not held back; their costs have the weights (K,)."""
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
        """Fit from the guess, or resume from ``start``; call ``stop`` and ``monitor`` after each iteration."""
        began = time.perf_counter()
        state = start or begin(self.problem.shared.guess, self.problem.own.guess)
        system = self.system(state.shared, state.own)
        if not system.finite:
            return FitOutcome(FitStatus.NOT_FINITE, START.format(names=self.failed_names(system.costs)), state, system)
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
        """Return the arrow at shared (s,) and own (K, o) numbers, for the fitted recordings."""
        self.jacobians += len(self.which)
        evaluated = self.problem.jacobian(shared, own, self.which)
        return assemble(self.problem, evaluated, shared, own, self.which, self.loss, self.weights)

    def _first(self, begun: FitState, system: ArrowSystem, began: float) -> FitState:
        """Return the first state, which sets lambda."""
        diagonals = np.diagonal(system.blocks, axis1=1, axis2=2)
        size = float(np.max(diagonals, initial=0.0))
        state = replace(begun, mark=system.cost, first=len(begun.history), **first_damping(self.options.damping, size))
        return self.recorded(state, system, 0.0, began)

    def recorded(self, state: FitState, system: ArrowSystem, step: float, began: float) -> FitState:
        """Return the state with a row of its history."""
        row = FitStep(
            iteration=len(state.history),
            merit=system.cost,
            left=self.errors_left(state, system),
            damping=state.damping,
            step=step,
            simulations=self.simulations,
            jacobians=self.jacobians,
            seconds=time.perf_counter() - began,
        )
        return replace(state, history=(*state.history, row))

    def free(self, state: FitState, system: ArrowSystem) -> tuple[Bools, Bools]:
        """Return (s,) and (k, o) of the fitted recordings: False where a bound holds a number."""
        shared = movable_numbers(self.problem.shared, state.shared, system.shared_gradient)
        own = movable_numbers(self.problem.own, state.own, system.own_gradient, self.which)
        return shared & (not self.hold_shared), own

    def errors_left(self, state: FitState, system: ArrowSystem) -> float:
        """Return the standard errors between the state and the minimum of its quadratic model."""
        return self.errors(system.expected_fall(*system.step(0.0, *self.free(state, system))), system)

    def _ended(self, state: FitState, system: ArrowSystem) -> tuple[FitStatus, str] | None:
        last = state.history[-1]
        if system.cost <= EXACT_MERIT * self.size:
            return FitStatus.CONVERGED, EXACTLY
        if last.left <= self.options.tolerance:
            return FitStatus.CONVERGED, LEFT.format(left=last.left)
        if state.quiet and not (arrow := self.determined(state, system)).whole:
            left = self.errors(system.expected_fall(*arrow.step()), system)
            if left <= self.options.tolerance:
                return FitStatus.CONVERGED, VAGUELY.format(
                    left=left, names=self._undetermined_names(arrow), far=last.left
                )
        if last.iteration - state.first >= self.options.iterations:
            return FitStatus.BUDGET, BUDGET
        if state.quiet >= (self.options.patience or math.inf):
            return self._stalled(SLOW, last.left)
        if self._model_fails(state, last.left):
            left = self.errors(system.expected_fall(*self.determined(state, system).step()), system)
            if self._model_fails(state, left):
                return self._stalled(SLOW, left)
        return None

    def _model_fails(self, state: FitState, left: float) -> bool:
        """Whether the last steps have achieved almost nothing of the predicted decrease."""
        patience, last = self.options.patience, state.history[-1]
        if not patience or last.iteration - state.first < patience:
            return False
        return state.history[-1 - patience].merit - last.merit < MIN_SHARE_OF_MODEL * left**2 * last.merit / self.size

    def determined(self, state: FitState, system: ArrowSystem, damping: float = 0.0) -> DeterminedArrow:
        """Return the system at the state without directions that are not determined."""
        numbers = (self.problem.shared, self.problem.own), (state.shared, state.own)
        return DeterminedArrow(system, number_units(*numbers, self.free(state, system), self.which), damping)

    def errors(self, fall: float, system: ArrowSystem) -> float:
        """Convert a decrease of the merit to standard errors."""
        return math.sqrt(max(0.0, fall) * self.size / system.cost) if system.cost > 0 else 0.0

    def _step(
        self, state: FitState, system: ArrowSystem, began: float
    ) -> tuple[FitState, ArrowSystem] | tuple[FitStatus, str] | tuple[FitStatus, str, Array]:
        """Take a step that lowers the merit, with the system there; lambda grows until there is one.

        Else how the fit ended, and at a kink how far from the shared numbers (s,) one side has its minimum.
        """
        model = RecordedModel(self, state, system)
        found, damped = descend(model, state)
        if found is None:
            if model.refused:
                return FitStatus.NOT_FINITE, TRIALS.format(names=model.refused)
            if model.left <= math.sqrt(RELATIVE_ROUNDING * self.size):
                return FitStatus.CONVERGED, LEFT.format(left=model.left) + ", below the rounding of the objective"
            return self._stalled(STALLED, model.left)
        if isinstance(found[0], FitStatus):
            return found
        moved, there = found
        progress = Progress(state.mark, state.quiet).after(there.cost, MIN_PROGRESS / self.size)
        mark, quiet = progress.mark, progress.quiet
        taken = replace(damped, shared=moved.shared, own=moved.own, mark=mark, quiet=quiet)
        return self.recorded(taken, there, moved.length, began), there

    @staticmethod
    def _stalled(reason: str, left: float) -> tuple[FitStatus, str]:
        """Return the end of a stalled fit, which counts as converged near the minimum of the model."""
        if left <= NEARLY_CONVERGED_ERRORS:
            return FitStatus.CONVERGED, NEARLY.format(left=left)
        return FitStatus.STALLED, reason.format(left=left)

    def moved(self, state: FitState, d_shared: Array, d_own: Array) -> Moved:
        """Return the numbers after a step (s,), (k, o) in scales, within the bounds."""
        shared_of, own_of, which = self.problem.shared, self.problem.own, self.which
        shared = np.clip(state.shared + shared_of.scale * d_shared, shared_of.lower, shared_of.upper)
        own = state.own.copy()
        own[which] += own_of.scale[which] * d_own
        own = np.clip(own, own_of.lower, own_of.upper)
        taken = (shared - state.shared) / shared_of.scale, self.step_of(state, own)
        length = math.sqrt(float(np.sum(taken[0] ** 2) + np.sum(taken[1] ** 2)))
        return Moved(shared, own, taken, length)

    def step_of(self, state: FitState, own: Array) -> Array:
        """Return (k, o) the step to own numbers (K, o), in scales."""
        return np.asarray(((own - state.own) / self.problem.own.scale)[self.which])

    def costs(self, shared: Array, own: Array, some: Ints | None = None) -> tuple[Array, float]:
        """Return (k,) costs of the recordings ``which[some]``, by default all, and that of the shared priors."""
        which, weights = (self.which, self.weights) if some is None else (self.which[some], self.weights[some])
        self.simulations += len(which)
        return costs(self.problem, shared, own, which, self.loss, weights)

    def _undetermined_names(self, arrow: DeterminedArrow) -> str:
        """Return the numbers in directions that are not determined."""
        shared = [name for name, vague in zip(self.problem.shared.names, arrow.vague_shared, strict=True) if vague]
        counts = zip(self.problem.own.names, arrow.vague_own.sum(axis=0), strict=True)
        return ", ".join([*shared, *(f"{name} of {count} recordings" for name, count in counts if count)])

    def failed_names(self, recordings: Array) -> str:
        """Return the names of recordings whose costs are not finite."""
        bad = [
            self.problem.recordings[k] for k, cost in zip(self.which, recordings, strict=True) if not np.isfinite(cost)
        ]
        return ", ".join(bad[:3]) + (f" and {len(bad) - 3} more" if len(bad) > 3 else "")


Taken = tuple[Moved, ArrowSystem] | tuple[FitStatus, str] | tuple[FitStatus, str, Array]
"""The state after a step and the system there, or how the fit ended."""


class RecordedModel(LocalModel[Moved, Taken]):
    """The merit of a fit about a state, for one iteration; see ``LocalModel``.

    Far from the minimum own steps of recordings that leave their model are shortened. Near to it, where steps are
    refused, the sides of a kink are collected, and steps are by all of them.

    Attributes:
        merit: at the state.
        left: standard errors to the minimum of the quadratic model.
        refused: names of recordings that were not finite after the last trial.
    """

    def __init__(self, fit: RecordingFit, state: FitState, system: ArrowSystem) -> None:
        """Start without trials."""
        self.fit, self.state, self.system = fit, state, system
        self.merit, self.left, self.refused = system.cost, state.history[-1].left, ""
        self._free = fit.free(state, system)
        self._near = self.left <= math.sqrt(sum(int(each.sum()) for each in self._free))
        self._kink, self._kinked = self._near and self.left > KINK_ERRORS, False
        self._sides = KinkedModel(system, self.merit / fit.size)

    def trial(self, damping: float) -> Trial[Moved]:
        """Simulate all recordings after a step."""
        fit = self.fit
        moved = fit.moved(self.state, *self._direction(damping))
        recordings, priors = fit.costs(moved.shared, moved.own)
        if not self._near:
            moved, recordings = self._with_shorter_steps(moved, recordings, damping)
        merit = float(recordings.sum()) + priors
        self.refused = "" if math.isfinite(merit) else fit.failed_names(recordings)
        return Trial(moved, merit, self._sides.expected_fall(*moved.taken))

    def judge(self, moved: Moved, gain: float) -> Taken | Refusal:
        """Accept a step that lowers the merit enough; at a kink a refused one adds one more side."""
        better = gain > (MIN_GAIN_AT_KINK if self._kinked else MIN_GAIN_RATIO)
        if better or (self._kinked and not self.refused):
            there = self.fit.system(moved.shared, moved.own)
            if not there.finite:
                self.refused = self.fit.failed_names(there.costs)
            elif better:
                return moved, there
            elif (found := self._add_side(there, moved.taken)) is not None:
                return found
        self._kinked = self._kink
        return Refusal.STIFFER

    def _add_side(self, there: ArrowSystem, taken: Step) -> Taken | Refusal | None:
        """Add the side of a refused step; return the end of the fit, a new step, or None for too many sides."""
        fit, model = self.fit, self._sides
        model.add(there, *taken)
        arrow = fit.determined(self.state, self.system)
        left = fit.errors(model.step(arrow)[2], self.system)
        if left <= max(KINK_ERRORS, fit.options.tolerance):
            away = arrow.step()[0] * fit.problem.shared.scale
            return FitStatus.CONVERGED, KINK.format(left=left, far=self.left), away
        if model.sides <= MAX_SIDES:
            return Refusal.AGAIN
        self._kink, self._sides = False, KinkedModel(self.system, self.merit / fit.size)
        return None

    def _direction(self, damping: float) -> Step:
        """Return the next step: by the sides of a kink, in determined directions, or damped."""
        fit, state, system = self.fit, self.state, self.system
        if self._kinked:
            return self._sides.step(fit.determined(state, system, damping))[:2]
        if state.quiet and not (arrow := fit.determined(state, system)).whole:
            return arrow.step()
        return system.step(damping, *self._free)

    def _with_shorter_steps(self, moved: Moved, reached: Array, damping: float) -> tuple[Moved, Array]:
        """Return the step and its costs (k,), with shorter steps of recordings that became worse.

        Own numbers of a recording have no effect on others, so that one that leaves its model need not hold up all.
        """
        fit, state, system = self.fit, self.state, self.system
        (d_shared, _), own, best = moved.taken, moved.own.copy(), reached.copy()
        stiff = np.einsum("kii->ki", system.blocks[:, system.s :, system.s :]).max(axis=1, initial=0.0)
        for share in RETRY_DAMPINGS:
            # Recordings whose cost exceeds their model, or grew against it.
            excess = best - system.costs + system.expected_falls(d_shared, fit.step_of(state, own))
            off = ~(excess <= MAX_MODEL_EXCESS * np.maximum(system.costs, best)) | (
                (best > system.costs) & (excess > 0)
            )
            some = np.flatnonzero(off)
            if not some.size or not system.blocks.shape[1] > system.s:
                break
            # Own steps with more damping; keep those that lower the cost.
            steps = system.own_step(d_shared, damping + share * stiff, self._free[1])
            tried = fit.moved(state, d_shared, steps).own
            trial = own.copy()
            trial[fit.which[some]] = tried[fit.which[some]]
            found, _ = fit.costs(moved.shared, trial, some)
            lower = some[found < best[some]]
            own[fit.which[lower]] = trial[fit.which[lower]]
            best[lower] = found[np.isin(some, lower)]
        return moved._replace(own=own, taken=(d_shared, fit.step_of(state, own))), best


def movable_numbers(parameters: FitParameters, values: Array, gradient: Array, which: Ints | None = None) -> Bools:
    """Apply ``movable`` to shared numbers (s,), or to own numbers (K, o) of the recordings ``which``."""
    some = slice(None) if which is None else which
    return movable(values[some], parameters.lower[some], parameters.upper[some], gradient)
