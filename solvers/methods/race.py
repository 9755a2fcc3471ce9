"""A race of a search and of methods that finish, for guesses from which a gradient says nothing.

Where hands do not touch the box, or feet leave the ground too late, descent ends in a stationary point far from every
target. A search among few numbers sees further, and finishes nothing. So CMA-ES searches for a round of generations
among splines of few knots about the guess. If it is far then, ilqr has two tries from the guess: for what is asked for
alone, and with the problem's own costs. A finisher goes on from what was found: exactly first, since a search leaves
little to do, then through all stages of smoothing. Where that misses, it hops: points are drawn about the best one, the
finisher descends from the best of these, and what comes nearer is the next to be hopped from (basin hopping, Wales and
Doye, J. Phys. Chem. A 101, 1997). Between hops the search goes on, and another one begins where that stands still;
whenever it has found something better, the finisher starts again. The race ends with the first point that meets
everything by a motion that can be relied on. From there it goes on to a stationary point where the problem asks for
one.

Until then costs hold nobody back from what is asked for. The search compares points by ``distance``, and ilqr takes
targets and constraints in units of their tolerances, beside which costs count little. (A car that should be quick
otherwise stays where it is quick and off the road; a hand that should be strong enough hardly moves.)

The finisher is ilqr where formulas look at one state each, least squares for a few numbers with squares, IPOPT for
others, or gradient descent for nets. Each part is a whole solve of that solver, with its own budget; the trace of the
race is theirs, one after the other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import asdict, astuple, replace
from functools import partial
from typing import Any

import numpy as np

from symphys.errors import SymphysError
from symphys.records import dataclass
from symphys.shooting import Measure, ShootingProblem, Values
from symphys.solvers.core.checkpoint import damaged, plain, revive, revived_rows
from symphys.solvers.core.driver import INTERRUPTED, counts_of, ignore_log
from symphys.solvers.core.evaluator import CountingEvaluator
from symphys.solvers.core.film import FilmPoint
from symphys.solvers.core.interface import Log, Solver
from symphys.solvers.core.options import SolverOptions, at_least, require
from symphys.solvers.core.outcome import Counts, Keep, Monitor, Outcome, StageResult, Status, StopReason, TraceRow
from symphys.solvers.core.point import Incumbent
from symphys.solvers.core.subspace import search_space
from symphys.solvers.methods.cma_es import CmaOptions, cma, load
from symphys.solvers.methods.gradient import GRADIENT
from symphys.solvers.methods.ilqr import ILQR
from symphys.solvers.methods.ipopt import IPOPT
from symphys.solvers.methods.least_squares import LEAST_SQUARES
from symphys.types import Array

MAX_SMALL = 300
"""Length of z up to which least squares finish."""
GROWTH, MOST = 2, 8
"""Factor on the population of a search that begins anew, and that of all of them at most."""
COST_WEIGHT = 0.5
"""What costs count for at most in the logarithm of ``distance``: enough to lead where nothing else moves."""
MARGIN = 0.5
"""[tolerances] What misses by less is not improved: finer time steps change it by that much and it is still met."""
CLOSE, CHECKED = 2.0, 8
"""[tolerances] Points that miss by no more are tried with finer time steps, so many of an evaluation at most."""
UNCHECKED = 1.001
"""[tolerances] The least error of others."""
FAR = 1e100
"""[tolerances] Errors are compared up to here."""
BETTER = 0.6
"""Share of the distance of the last start of the finisher below which it starts again."""
FIRST_ROUNDS = 4
"""Rounds of the search for controls over time before the finisher starts, whose slopes are compiled meanwhile."""
STALE, NEARLY = 6, 0.95
"""Rounds after which a search ends that has not come below this share of its ``distance``: another one begins."""
PATIENCE = 10
"""Iterations without progress after which the finisher gives up a start; with something missed, after which it lowers
the costs of what is met no further."""
NO_LIMIT = 10**12
"""Evaluations of a search, which its rounds limit."""
SEEDS = 100_000
"""Between the seeds of searches that begin anew."""
LOWEST = "everything is met, and no step lowers the costs: the point is a minimum or lies at a kink"
ASTRAY = "cheaper points violate a target or constraint"
GIVEN_UP = "hops about it come no nearer: another guess, or stages of smoothing"
USED_UP = "the finisher's iterations are used up: raise `finisher_iterations`"
HOP_SIGMAS, HOP_KNOTS = (0.05, 0.1, 0.2), (3, 4, 6, 2)
"""Of one hop after another: standard deviation in units of that of the search, and knots of splines."""
DRAWN = 64
"""Points that are drawn for a hop, of which the best is taken."""
HOP_PATIENCE, HOP_SHARE = 4, 0.97
"""A finisher gives up a hop where so many iterations have not brought the largest miss below this share of itself."""
HOPS_AHEAD, HOPS_BESIDE, FAR_HOP = 8, 2, 4
"""Hops between two rounds of the search: where they have come nearer than it, and where not; every fourth is far."""
TRY_ITERATIONS = 100
"""Iterations of ilqr from the guess, in each stage of smoothing."""
PROMISING = 5.0
"""[tolerances] The largest miss after ``finisher_iterations`` of these with which it goes on. A search that is so near
is finished first."""
HALF = 0.5
"""Share of what the search misses with which a try for what is asked for goes on, too."""
NAME, SEARCH, HOP, LEAP = "race", "search", "hop", "leap"
FINISH, RELAX, POLISH, ASKED, OWN = "finish", "relax", "polish", "asked", "own"
HOPS, TRIES = (HOP, LEAP), (ASKED, OWN)


@dataclass(frozen=True)
class RaceOptions(SolverOptions):
    """Options of the race.

    Attributes:
        finisher_iterations: iterations of the finisher in each smoothing stage, at each start, and of the final
            convergence.
        rounds: largest number of search rounds.
        generations: in each round.
        population: candidates in each generation.
        knots: knots of the search splines, for each control.
        sigma: initial standard deviation of the search, in quarters of the distance of bounds.
    """

    finisher_iterations: int = 30
    rounds: int = 30
    generations: int = 10
    population: int = 64
    knots: int = 6
    sigma: float = 1.0

    def __post_init__(self) -> None:
        """Raise ValueError, which names the option and what would be valid."""
        super().__post_init__()
        at_least(1, generations=self.generations, knots=self.knots)
        at_least(0, rounds=self.rounds, finisher_iterations=self.finisher_iterations)
        require(self.population > 2, "population", "at least 3")
        require(0 < self.sigma < math.inf, "sigma", "above 0")


@dataclass(frozen=True)
class RacePart:
    """A solve that is part of a race, and is over or paused.

    Attributes:
        kind: SEARCH; FINISH, exactly, until everything is met; HOP and LEAP, as FINISH from the best of some points
            that are drawn about the start; RELAX, as FINISH through all stages of smoothing; ASKED and OWN, as FINISH
            and RELAX from the guess, OWN with the problem's own costs; POLISH, exactly, until the objective is
            stationary.
        status, advice: how it ended; INTERRUPTED: a search that goes on.
        z: (n,) its best point.
        objective, max_violation, met: of that point, exactly; see ``Point``.
        distance: of that point, see ``distance``.
        confirmed: whether it meets everything, and is confirmed where somebody can.
        counts, seconds: of this part alone.
    """

    kind: str
    status: Status
    advice: str
    z: Array
    objective: float
    distance: float
    max_violation: float
    met: bool
    confirmed: bool
    counts: Counts
    seconds: float

    @property
    def rank(self) -> tuple[bool, bool, float]:
        """Return the sort key, lower is better, as ``Point.rank``."""
        return not self.confirmed, not self.met, self.distance if math.isfinite(self.distance) else math.inf


@dataclass(frozen=True)
class Shift:
    """The offsets that turn rows of a part's trace into rows of the race's.

    Attributes:
        rows, counts, seconds: added.
        skip: how many rows the part had before, which the race has already.
    """

    rows: int
    counts: Counts
    seconds: float
    skip: int = 0

    def moved(self, row: TraceRow) -> TraceRow:
        """Return the row of the race."""
        counts = asdict(counts_of(row) + self.counts)
        return replace(row, iteration=row.iteration + self.rows, seconds=row.seconds + self.seconds, **counts)


Plan = Generator[tuple[str, Array], RacePart, None]
"""Yields kind and start (n,) of a part, and takes what became of it."""


def distance(objectives: Array, errors: Array, scale: float) -> Array:
    """Return (batch,) how far points are from all that is asked for, 1 with nothing missing, times what they cost.

    The errors (batch, k) beyond half the tolerances are summed as squares. The share of the objectives (batch,) is
    bounded, so that none can outweigh what is missing by more than a factor; ``scale`` is a typical size of them. Where
    nothing is asked for it is the objective.
    """
    if not errors.shape[1]:
        return objectives
    beyond = np.minimum(np.maximum(errors - MARGIN, 0), FAR)
    size = np.minimum(np.abs(objectives), FAR)
    share = np.copysign(size, objectives) / np.maximum(size + scale, np.finfo(float).tiny)
    return np.asarray((1 + np.sum(beyond**2, axis=1)) * np.exp(COST_WEIGHT * share))


class WithFinerSteps:
    """An evaluator whose points meet everything only if finer time steps do not refute it.

    A box that is struck and comes to rest where it should does so with one time step; one that is carried, with all.
    """

    def __init__(self, problem: ShootingProblem, finer: Callable[[Array], Array], measure: Measure) -> None:
        """Wrap the evaluator of a problem; ``finer``: Z (B, n) -> errors (B, k); ``measure``: what comes first."""
        self.problem, self.finer, self.measure = problem, finer, measure

    def value(self, Z: Array, smoothing: float) -> Values:
        """Implement ``Evaluator.value``."""
        values = self.problem.evaluator.value(Z, smoothing)
        close = np.flatnonzero((values.errors <= CLOSE).all(axis=1))
        if smoothing or not len(close):
            return values
        errors = values.errors.copy()
        first = close[np.argsort(self.measure(values.objective[close], errors[close]), kind="stable")]
        checked, others = first[:CHECKED], first[CHECKED:]
        found = self.finer(Z[checked])
        errors[checked] = np.maximum(errors[checked], np.where(np.isnan(found), FAR, found))
        errors[others] = np.maximum(errors[others], UNCHECKED)
        return replace(values, errors=errors)

    def __getattr__(self, name: str) -> Any:
        """Return what else the evaluator of the problem has."""
        return getattr(self.problem.evaluator, name)


def following(plan: Plan, part: RacePart) -> tuple[str, Array] | None:
    """Return what a plan asks for after a part; None: it is at its end."""
    try:
        return plan.send(part)
    except StopIteration:
        return None


class Paused(KeyboardInterrupt):
    """Ends a part: a search whose round is over, or one within which a limit of the race is reached."""


class Race:
    """One race. What it does next follows from the parts that are over: so it goes on by replaying these."""

    def __init__(
        self,
        problem: ShootingProblem,
        options: RaceOptions,
        seed: int,
        monitor: Monitor | None,
        log: Log,
        keep: Keep | None,
    ) -> None:
        """Prepare a race; the arguments are those of ``interface.Solve``."""
        self.finisher = finisher(problem)
        if self.finisher is ILQR and problem.by_steps is not None:
            problem = replace(problem, evaluator=problem.by_steps)
        self.problem, self.options, self.seed = problem, options, seed
        self.compared = replace(problem, measure=self._measure)
        if problem.finer_errors is not None:
            finer = WithFinerSteps(problem, problem.finer_errors, self._measure)
            self.compared = replace(self.compared, evaluator=finer)
        self.scale: float | None = None
        self.monitor, self.log, self.keep = monitor, log, keep
        self.evaluator = CountingEvaluator(self.compared, problem.smoothing[-1], Incumbent(stop_when_met=False))
        self.cma = cma(keep=True)
        self.parts: list[RacePart] = []
        self.rows: list[TraceRow] = []
        self.film: list[FilmPoint] = []
        self.stages: dict[float, StageResult] = {}
        self.searching: dict[str, Any] = {}
        self.running: dict[str, Any] = {}
        self.finished: Outcome | None = None
        self.pausing = self.stopping = False
        self.spent: StopReason | None = None

    def run(self, start: Array, checkpoint: dict[str, Any] | None) -> Outcome:
        """Race from ``start`` (n,)."""
        if checkpoint:
            self._resume(checkpoint)
        self.start = self.evaluator.clip(np.array(start, float))
        plan = self._plan(self.start)
        asked = next(plan, None)
        over, self.parts = self.parts, []
        for part in over:
            self.parts.append(part)
            asked = following(plan, part)
        try:
            if asked and self._begun_part_is_over(asked[0]):
                asked = following(plan, self.parts[-1])
            while asked and self.spent is None:
                kind, z = asked
                outcome = self._solve(kind, z)
                if outcome.status is Status.INTERRUPTED and not self.pausing:
                    return self._interrupted(kind, outcome.checkpoint)
                self._take(kind, outcome)
                if self.stopping:
                    return self._interrupted(kind, {})
                asked = following(plan, self.parts[-1])
        except (RuntimeError, ArithmeticError, np.linalg.LinAlgError, MemoryError) as error:
            return self._outcome(StopReason(Status.FAILED, f"{NAME} failed: {str(error).strip() or error!r}"))
        return self._outcome(self.spent)

    def _begun_part_is_over(self, kind: str) -> bool:
        """Whether the part that ran as a resumed race was interrupted had reached a limit, or its end as a round."""
        rows = revived_rows(self.running) if self.running else []
        last = self._shift(kind).moved(rows[-1]) if rows else self.rows[-1] if self.rows else None
        self.spent = self.options.spent(last) if last else None
        given_up = bool(rows) and self._gives_up(kind, rows)
        self.pausing = given_up or (kind == SEARCH and last is not None and last.iteration >= self._round_ends)
        if not rows or not (self.spent or self.pausing):
            return False
        z, counts = np.array(self.running["best"]["z"], float), Counts(*map(int, self.running["counts"]))
        self._take(kind, Outcome(Status.INTERRUPTED, "", z, tuple(rows), counts, self.running))
        return True

    def _gives_up(self, kind: str, rows: Sequence[TraceRow]) -> bool:
        """Whether a part ends with the last of its ``rows``.

        A try from the guess does if it is far after some iterations; what lowers the costs of what is met if it leads
        away from that: some iterations miss it, and ever more.
        """
        row, last = rows[-1], [each.max_violation for each in rows[-PATIENCE:]]
        if kind == POLISH:
            return len(rows) > PATIENCE and all(each > 1 for each in last) and last[-1] >= last[0]
        if kind in HOPS and len(rows) > HOP_PATIENCE:
            return min(last[-HOP_PATIENCE:]) > HOP_SHARE * min(each.max_violation for each in rows[:-HOP_PATIENCE])
        if kind not in TRIES or row.iteration != self.options.finisher_iterations:
            return False
        searched = min((part.max_violation for part in self.parts if part.kind == SEARCH), default=0.0)
        return row.max_violation > (PROMISING if kind == OWN else max(PROMISING, HALF * searched))

    @property
    def _asks(self) -> bool:
        """Whether anything is asked for but a low objective."""
        return not self.parts or not math.isnan(self.parts[0].max_violation)

    @property
    def _round_ends(self) -> int:
        """The number of the row with which a round of the search ends."""
        return len(self.rows) + self.options.generations

    def _plan(self, guess: Array) -> Plan:
        """Say what is solved next, and from where."""
        tried, guessed = math.inf, False
        alone = min(FIRST_ROUNDS if over_time(self.problem) else 1, self.options.rounds)
        for number in range(self.options.rounds):
            found = yield SEARCH, guess
            if self._over(found):
                return
            if found.confirmed:
                yield POLISH, found.z
                return
            if number + 1 < alone:
                continue
            if self.finisher is ILQR and not guessed and found.max_violation > PROMISING:
                guessed = True
                if (yield from self._from_guess(guess)):
                    return
            if found.distance < BETTER * tried:
                tried = found.distance
                guessed = guessed or np.array_equal(found.z, guess)
                if (yield from self._finishing(found.z, FINISH)):
                    return
            if not guessed and (yield from self._from_guess(guess)):
                return
            guessed = True
            if (yield from self._hopping(guess)):
                return
        if not guessed and (yield from self._finishing(guess, RELAX)):
            return
        yield POLISH, self._nearest.z

    def _from_guess(self, guess: Array) -> Generator[tuple[str, Array], RacePart, bool]:
        """Say what is tried from the guess (n,); return whether the race is over."""
        if self.finisher is not ILQR or not self._asks:
            return (yield from self._finishing(guess, RELAX))
        for kind in TRIES:
            found = yield kind, guess
            if self._over(found):
                return True
            if found.met:
                polished = yield POLISH, found.z
                if found.confirmed or self._over(polished):
                    return True
                continue
            near = found.status is Status.BUDGET and found.max_violation <= PROMISING
            if near and (yield from self._finishing(found.z, FINISH)):
                return True
        return False

    def _finishing(
        self, start: Array, first: str, relaxed: bool = False
    ) -> Generator[tuple[str, Array], RacePart, bool]:
        """Say how the finisher goes on from ``start`` (n,), as ``first`` does; return whether the race is over.

        ``relaxed``: whether there is no need to try it with smoothing.
        """
        kind, before = first if self._asks else RELAX, math.inf
        relaxed = relaxed or len(self.problem.smoothing) == 1
        while True:
            found = yield kind, start
            if self._over(found):
                return True
            if found.met or not self._asks:
                polished = yield POLISH, found.z
                return found.confirmed or self._over(polished)
            relaxed = relaxed or kind == RELAX
            if found.status is Status.BUDGET and found.distance < BETTER * before:
                kind, start, before = FINISH, found.z, found.distance
            elif relaxed or (self._asks and found.max_violation > PROMISING):
                return False
            else:
                kind, start = RELAX, found.z

    def _hopping(self, guess: Array) -> Generator[tuple[str, Array], RacePart, bool]:
        """Say how some hops go; return whether the race is over."""
        most = (HOPS_BESIDE if self._nearest.kind == SEARCH else HOPS_AHEAD) if self._asks else 0
        for _ in range(most):
            best, done = self._nearest, sum(part.kind in HOPS for part in self.parts)
            found = yield (LEAP, guess) if done % FAR_HOP == FAR_HOP - 1 else (HOP, best.z)
            if self._over(found):
                return True
            better = found.rank < best.rank and (found.met or found.distance < BETTER * best.distance)
            if better and (yield from self._finishing(found.z, FINISH, relaxed=True)):
                return True
        return False

    @property
    def _nearest(self) -> RacePart:
        """Return the best part."""
        best = self._best()
        assert best is not None, "there was a guess"
        return best

    def _over(self, part: RacePart) -> bool:
        """Whether a part ends the race."""
        if part.status.fatal or (part is self.parts[0] and not math.isfinite(part.distance)):
            return True
        if math.isnan(part.max_violation):  # nothing is asked for but a low objective
            return part.kind == POLISH or (part.kind == RELAX and part.status is not Status.BUDGET)
        return part.confirmed and (self.problem.stop_when_met or part.kind == POLISH)

    def _solve(self, kind: str, start: Array) -> Outcome:
        """Solve a part, from its checkpoint where it has one."""
        shift, self.pausing = self._shift(kind), False
        last, rows = self._round_ends, revived_rows(self.running) if self.running else []

        def see(row: TraceRow) -> None:
            moved = shift.moved(row)
            rows.append(row)
            self.spent = self.options.spent(moved)
            round_ends = kind == SEARCH and moved.iteration >= last
            self.pausing = self.spent is not None or round_ends or self._gives_up(kind, rows)
            try:
                if self.monitor:
                    self.monitor(moved)
            except KeyboardInterrupt:
                self.stopping = True
                raise
            if self.pausing:
                raise Paused

        def offer(make: Callable[[], dict[str, object]]) -> None:
            if self.keep:
                self.keep(lambda: self._saved(kind, make()))

        searches = sum(part.kind == SEARCH and part.status is not Status.INTERRUPTED for part in self.parts)
        chosen, problem, options = self._part(kind, start, searches)
        running = self.running or (self.searching if kind == SEARCH else {})
        seed = self.seed + SEEDS * searches
        if kind in HOPS and not running:
            start = self._drawn(kind, start)
        self.log(f"{kind}, part {len(self.parts) + 1} of the race")
        return chosen.solve(problem, start, options, seed, see, running or None, self.log, offer)

    def _part(self, kind: str, start: Array, searches: int) -> tuple[Solver[Any], ShootingProblem, SolverOptions]:
        """Return solver, problem and options of a part from ``start`` (n,); ``searches``: how many are over."""
        options, last = self.options, self.problem.smoothing[-1:]
        if kind == SEARCH:
            sought = CmaOptions(
                sigma=options.sigma,
                knots=options.knots,
                population=options.population * min(GROWTH**searches, MOST),
                evaluations=NO_LIMIT,
                validation=0,
            )
            return self.cma, replace(self.compared, smoothing=last), sought
        patience = {"patience": PATIENCE} if self.finisher is ILQR else {}
        problem = self.problem
        if self.finisher is ILQR and problem.staged is not None:
            steps = problem.staged().without_forces()
            problem = replace(problem, staged=lambda: steps)
        if kind == POLISH:
            own = self.finisher.Options(iterations=options.finisher_iterations, **patience)
            return self.finisher, replace(problem, smoothing=last), own
        meeting = replace(problem, stop_when_met=True)
        if kind in (FINISH, ASKED, *HOPS):
            meeting = replace(meeting, smoothing=last)
        if kind != OWN and self.finisher is ILQR and problem.asking is not None:
            meeting = replace(meeting, staged=partial(problem.asking, start), measure=self.compared.measure)
        iterations = TRY_ITERATIONS if kind in TRIES else options.finisher_iterations * self._growth
        return self.finisher, meeting, self.finisher.Options(iterations=iterations, **patience)

    def _drawn(self, kind: str, start: Array) -> Array:
        """Return the best of some points that are drawn about ``start`` (n,) for a hop."""
        hops = sum(part.kind == kind for part in self.parts)
        sigma = self.options.sigma * (HOP_SIGMAS[hops % len(HOP_SIGMAS)] if kind == HOP else 1.0)
        knots = HOP_KNOTS[hops % len(HOP_KNOTS)]
        space, stream = search_space(self.problem, start, knots), np.random.default_rng([self.seed, len(self.parts)])
        drawn = sigma * stream.standard_normal((DRAWN, len(space.origin)))
        points = self.evaluator.rate([self.evaluator.clip(space.z(space.origin + x * space.scale)) for x in drawn])
        return min(points, key=lambda point: point.rank).z

    @property
    def _growth(self) -> int:
        """Return the factor on the iterations of a finisher that goes on where its last ones were used up.

        A start anew forgets the multipliers of constraints, so many short ones come to nothing.
        """
        ended = 0
        for part in reversed(self.parts):
            if part.kind == SEARCH or part.status is not Status.BUDGET:
                break
            ended += 1
        return min(int(GROWTH**ended), MOST)

    def _measure(self, objectives: Array, errors: Array) -> Array:
        """Return ``distance`` in units of the first objective that is evaluated: that of the guess."""
        if self.scale is None:
            self.scale = abs(float(objectives[0]))
        return distance(objectives, errors, self.scale)

    def _shift(self, kind: str) -> Shift:
        """Return how the rows of a part become those of the race."""
        before = Shift(len(self.rows), self._counts(), self._seconds())
        saved = self.searching if kind == SEARCH else {}
        if not saved:
            return before
        seen = Shift(len(saved["rows"]), Counts(*map(int, saved["counts"])), float(saved["seconds"]))
        return Shift(before.rows - seen.rows, before.counts - seen.counts, before.seconds - seen.seconds, seen.rows)

    def _counts(self) -> Counts:
        return sum((part.counts for part in self.parts), Counts())

    def _seconds(self) -> float:
        return sum(part.seconds for part in self.parts)

    def _best(self) -> RacePart | None:
        return min(reversed(self.parts), key=lambda part: part.rank, default=None)

    def _take(self, kind: str, outcome: Outcome) -> None:
        """Add a part that is over, or paused."""
        shift = self._shift(kind)
        rows = [shift.moved(row) for row in outcome.trace[shift.skip :]]
        shown = [point for point in outcome.film if shift.skip <= point.row < len(outcome.trace)]
        self.film += [replace(point, row=shift.moved(outcome.trace[point.row]).iteration) for point in shown]
        seconds = rows[-1].seconds - self._seconds() if rows else 0.0
        (point,) = self.evaluator.rate([outcome.z])
        counts = outcome.counts + shift.counts - self._counts() + Counts(rollouts=1 + DRAWN * (kind in HOPS))
        known = next((part for part in reversed(self.parts) if np.array_equal(part.z, point.z)), None)
        if known is not None:
            confirmed = known.confirmed
        else:
            confirmed = point.met and (self.problem.confirms is None or self.problem.confirms(point.z))
        goes_on = self.pausing and confirmed >= point.met  # not towards what is met and does not hold
        if kind == SEARCH and self.pausing and not goes_on:
            outcome = replace(outcome, status=Status.MET, advice="")
        if kind == SEARCH and goes_on and self._is_stale(point.merit):
            goes_on, outcome = False, replace(outcome, status=Status.STALLED, advice="")
        if kind != SEARCH and self.pausing and self.spent is None:
            outcome = replace(outcome, status=Status.STALLED, advice=ASTRAY if kind == POLISH else GIVEN_UP)
        numbers = point.objective, point.merit, point.max_violation, point.met, confirmed
        part = RacePart(kind, outcome.status, outcome.advice, outcome.z, *numbers, counts, seconds)
        self._add_stages(part, outcome.stages if kind != SEARCH else ())
        best = self._best()
        if best is None or part.rank <= best.rank:
            self.finished = outcome
        self.parts.append(part)
        self.rows += rows
        self.running = {}
        if kind == SEARCH:
            self.searching = outcome.checkpoint if goes_on else {}
        self.log(f"{kind}: {outcome.status.value}, objective {point.objective:g}, worst {point.max_violation:g}")

    def _is_stale(self, distance: float) -> bool:
        """Whether the search that goes on has come hardly nearer in some rounds, so that another one begins."""
        rounds = list[float]()
        for part in reversed(self.parts):
            if part.kind == SEARCH and part.status is not Status.INTERRUPTED:
                break
            rounds += [part.distance] * (part.kind == SEARCH)
        return len(rounds) >= STALE and distance > NEARLY * rounds[STALE - 1]

    def _add_stages(self, part: RacePart, stages: tuple[StageResult, ...]) -> None:
        """Add the stages of a part to those of the race; what is left of its work is that of the exact stage."""
        rest = part.counts - sum((stage.counts for stage in stages), Counts())
        left = part.seconds - sum(stage.seconds for stage in stages)
        numbers = part.objective, part.max_violation, rest, left
        for stage in (*stages, StageResult(self.evaluator.smoothing, part.status, part.z, *numbers)):
            known = self.stages.get(stage.smoothing)
            if known is not None:
                stage = replace(stage, counts=known.counts + stage.counts, seconds=known.seconds + stage.seconds)
            self.stages[stage.smoothing] = stage

    def _outcome(self, reason: StopReason | None) -> Outcome:
        """Return the best of all parts; ``reason`` why the race ended, None: as its parts did."""
        best = self._best()
        if best is None:
            assert reason is not None, "a race has a part"
            return Outcome(reason.status, reason.advice, self.start, tuple(self.rows), self._counts())
        last = next((part for part in reversed(self.parts) if part.kind != SEARCH), self.parts[-1])
        ended = best if best.kind != SEARCH else last
        ended = self.parts[-1] if self.parts[-1].status.fatal else ended
        status, advice = ended.status, ended.advice if ended.status is not Status.BUDGET else USED_UP
        if best.confirmed and status is Status.STALLED:
            advice = LOWEST
        if reason:
            status, advice = reason.status, reason.advice
        elif best.met and self.problem.stop_when_met:
            status, advice = Status.MET, ""
        stages = self._stages()
        stages[-1] = replace(
            stages[-1], status=status, z=best.z, objective=best.objective, max_violation=best.max_violation
        )
        known = self.finished
        return Outcome(
            status,
            advice,
            best.z,
            tuple(self.rows),
            self._counts(),
            stages=tuple(stages),
            gains=known.gains if known else {},
            multipliers=known.multipliers if known else {},
            film=tuple(self.film),
        )

    def _stages(self) -> list[StageResult]:
        return [self.stages[each] for each in self.problem.smoothing if each in self.stages]

    def _interrupted(self, kind: str, running: dict[str, Any]) -> Outcome:
        """Return the outcome of a race that is interrupted; ``running``: the checkpoint of a part, {} between two."""
        if not (running or self.parts):
            return Outcome(Status.INTERRUPTED, INTERRUPTED, self.start, (), Counts())
        saved = self._saved(kind, running)
        z, counts = np.array(saved["best"]["z"], float), Counts(*saved["counts"])
        rows, stages = tuple(revived_rows(saved)), tuple(self._stages())
        return Outcome(Status.INTERRUPTED, INTERRUPTED, z, rows, counts, saved, stages)

    def _saved(self, kind: str, running: dict[str, Any]) -> dict[str, Any]:
        """Return the checkpoint of a race with that of the part that runs."""
        shift, best = self._shift(kind), self._best()
        more = [shift.moved(row) for row in revived_rows(running)[shift.skip :]] if running else []
        return {
            "solver": NAME,
            "best": {"z": plain(best.z) if best else running["best"]["z"]},
            "counts": list(astuple(counts_of(more[-1]) if more else self._counts())),
            "seconds": more[-1].seconds if more else self._seconds(),
            "rows": [list(astuple(row)) for row in (*self.rows, *more)],
            "over": len(self.rows),
            "parts": plain(self.parts),
            "stages": plain(list(self.stages.values())),
            "searching": self.searching,
            "running": running,
        }

    def _resume(self, saved: dict[str, Any]) -> None:
        """Go on from a checkpoint; SymphysError if it is damaged or of another solve."""
        if saved.get("solver") != NAME:
            raise SymphysError(f"this checkpoint is of the solver {saved.get('solver')!r}, not of {NAME!r}")
        try:
            self.parts = [revive(RacePart, each, Counts) for each in saved["parts"]]
            self.stages = {float(each["smoothing"]): revive(StageResult, each, Counts) for each in saved["stages"]}
            rows = revived_rows(saved)
            self.rows, self.scale = rows[: int(saved["over"])], abs(rows[0].objective) if rows else None
            self.searching, self.running = dict(saved["searching"]), dict(saved["running"])
            size = len(saved["best"]["z"])
        except (KeyError, TypeError, ValueError) as error:
            raise damaged(error) from error
        if size != self.problem.n:
            raise SymphysError(f"this checkpoint has {size} variables, the problem {self.problem.n}")


def finisher(problem: ShootingProblem) -> Solver[Any]:
    """Return the solver that finishes."""
    if by_steps(problem):
        return ILQR
    if problem.squares and problem.n <= MAX_SMALL:
        return LEAST_SQUARES
    return GRADIENT if problem.nlp.expression is None else IPOPT


def over_time(problem: ShootingProblem) -> bool:
    """Whether a variable has several knots."""
    return any(block.shape[1] > 1 for block in problem.blocks)


def by_steps(problem: ShootingProblem) -> bool:
    """Whether all is evaluated step by step."""
    if problem.staged is None:
        return False
    try:
        problem.staged()
    except SymphysError:
        return False  # formulas look at more than one state
    return True


def solve(
    problem: ShootingProblem,
    start: Array,
    options: RaceOptions,
    seed: int = 0,
    monitor: Monitor | None = None,
    checkpoint: dict[str, object] | None = None,
    log: Log | None = None,
    keep: Keep | None = None,
) -> Outcome:
    """Solve as ``interface.Solve`` has it."""
    race = Race(problem, options, seed, monitor, log or ignore_log, keep)
    if race.finisher is ILQR and problem.staged is not None:
        steps = problem.staged().without_forces()
        steps.prepare(slopes=over_time(problem))  # few numbers may be found before any slope is needed
    return race.run(start, checkpoint)


RACE: Solver[RaceOptions] = Solver(
    NAME,
    "CMA-ES over splines, descent from the best point that it has found, and hops about that",
    RaceOptions,
    solve,
    prepare=load,
    by_steps=by_steps,
    confirms=True,
)
