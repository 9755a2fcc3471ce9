"""result.json: the result of a run. Every field is declared here once, for writers and readers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import field
from pathlib import Path
from typing import Any, Self

import numpy as np

from symphys import files
from symphys import json_values as values
from symphys.findings.levels import Judged
from symphys.findings.verdict import ACCEPTED, NOT_SOLVED, Verdict, judge_run
from symphys.json_values import Text
from symphys.records import dataclass
from symphys.results.trace import renamed
from symphys.types import Array

FORMAT = 1
ADDED_LATER = {"verdict", "doubts", "again", "provenance"}
"""Fields that older files do not have."""
REACHED = frozenset(
    (
        *("objective", "costs", "outputs", "checks", "z", "iterations", "counts", "price", "equivalents", "seconds"),
        *("trust", "guess", "stages"),
    )
)
"""Fields that a failed run does not reach: null in the file."""


@dataclass(frozen=True)
class CheckRecord:
    """A target, constraint or goal: ``error`` and ``tolerance`` in its own unit; met where ``ratio`` <= 1.

    ``kind``: "target", "constraint" or "goal". ``name``: as in the problem file. ``unit``: empty where it is not known.
    """

    kind: str
    name: str
    error: float
    tolerance: float
    ratio: float
    met: bool
    unit: str = ""

    @classmethod
    def from_json(cls, value: object, text: Text = values.name) -> CheckRecord:
        """Read a check; one without a kind is a "check", one without a name has that of its kind."""
        entry = value if isinstance(value, dict) else {}
        kind = text(entry.get("kind")) or "check"
        read = values.record(cls, value, text, kind=kind, name=text(entry.get("name")) or kind)
        return read if "ratio" in entry else dataclasses.replace(read, ratio=_share(read.error, read.tolerance))


def _share(error: float, tolerance: float) -> float:
    """Return error / tolerance; inf for an error without tolerance."""
    if tolerance > 0:
        return error / tolerance
    return 0.0 if error == 0 else error * np.inf


@dataclass(frozen=True, eq=False)
class VariableRecord:
    """A variable of a result; two are equal if the file has the same of them.

    Attributes:
        name: in the problem file; the key in the file.
        sets: the quantities that it sets, as the problem file writes them where that can be read.
        value, guess: (components, knots); flat in the file, knot after knot, beside their ``shape``.
        lower, upper: (components, knots) bounds, infinite where there is none, which is null in the file.
        unit: of all these; empty for pure numbers, and where it is not known.
        time: (knots,) [s] of the knots of an input; of one that is held, from when; empty where there are none, and in
            older files.
        held: [s] how long each knot holds; 0 where inputs go in straight lines from knot to knot.
    """

    name: str
    sets: tuple[str, ...]
    value: Array
    guess: Array
    lower: Array
    upper: Array
    unit: str = ""
    time: Array = field(default_factory=lambda: np.zeros(0))
    held: float = 0.0

    @classmethod
    def from_json(cls, value: object, text: Text = values.name) -> VariableRecord:
        """Read a variable without its name; a shape that does not fit the values is replaced by one knot."""
        entry = values.table(value)
        size = values.numbers(entry.get("value")).size
        shape = [values.whole(number) for number in values.numbers(entry.get("shape"))[:2]]
        fits = len(shape) == 2 and min(shape) > 0 and shape[0] * shape[1] == size
        components, knots = (shape[0], shape[1]) if fits else (size, 1)

        def block(key: str, missing: float) -> Array:
            flat = values.numbers(entry.get(key))
            flat = flat if flat.size == size else np.full(size, np.nan)
            return np.where(np.isnan(flat), missing, flat).reshape((knots, components)).T

        arrays = {key: block(key, np.nan) for key in ("value", "guess")}
        bounds = {"lower": block("lower", -np.inf), "upper": block("upper", np.inf)}
        return values.record(cls, value, text, name="", **arrays, **bounds)

    def __eq__(self, other: object) -> bool:
        """Whether the file has the same of both."""
        return isinstance(other, VariableRecord) and files.strict(self.to_json()) == files.strict(other.to_json())

    def to_json(self) -> dict[str, Any]:
        """Return the entry of the file."""
        flat = {key: getattr(self, key).T.ravel().tolist() for key in ("value", "guess", "lower", "upper")}
        for key in ("lower", "upper"):
            flat[key] = [number if math.isfinite(number) else None for number in flat[key]]
        times = {"time": self.time.tolist(), "held": self.held} if self.time.size else {}
        return {"sets": list(self.sets), "unit": self.unit, "shape": list(self.value.shape), **flat, **times}


@dataclass(frozen=True)
class StageRecord:
    """A stage of continuation in the smoothing, and its best point.

    Attributes:
        smoothing: of the contacts [m/s].
        status: how it ended.
        objective, worst: of its best point at this smoothing; ``worst`` is the largest error / tolerance.
        exact_objective, exact_worst, solved: the same point in the exact rollout.
        counts: evaluations by kind, those of the stages before it left out.
        equivalents: their cost in rollouts.
        seconds: wall time, likewise.
    """

    smoothing: float
    status: str
    objective: float
    worst: float
    exact_objective: float
    exact_worst: float
    solved: bool
    counts: Mapping[str, float]
    equivalents: float
    seconds: float


@dataclass(frozen=True)
class BackendRecord:
    """The backend that evaluated the functions.

    Attributes:
        name: of the backend.
        lanes, threads: rollouts that one instruction computes; blocks that are computed at once.
        precision: of the arithmetic.
        compiler: and its version; empty where nothing is compiled.
        note: why it is not what was asked for, or empty.
        compiled: "cold", "warm" (from the cache) or empty.
    """

    name: str = ""
    lanes: int = 0
    threads: int = 0
    precision: str = ""
    compiler: str = ""
    note: str = ""
    compiled: str = ""

    def __str__(self) -> str:
        """Describe the backend in a line."""
        counts = [f"{n} {what}{'s' * (n > 1)}" for n, what in ((self.lanes, "lane"), (self.threads, "thread")) if n]
        start = {"cold": "compiled anew", "warm": "taken from the cache"}.get(self.compiled, "")
        parts = [self.name, *counts, self.precision and f"{self.precision} precision", self.compiler, start]
        return "; ".join(filter(None, [", ".join(filter(None, parts)), self.note]))


@dataclass(frozen=True, eq=False)
class Result:
    """A solve, judged by the exact rollout at smoothing 0; nan or empty is what is not known.

    Two are equal if their files are. A number whose field has a ``label`` is shown under it at the top of the page,
    rounded to so many ``decimals`` if the field says so; a new one is named in ``ADDED_LATER``, so that
    older files can be read, and filled in by ``runs.record``.

    Attributes:
        problem, title: the file's stem and its title.
        solver, seed: solver, and number of the start.
        solved: whether every check is met, or the point is stationary where there is none, by a motion that can be
            relied on; the same as a verdict of "solved".
        status, advice: how the solver ended and what to try.
        objective: of the exact rollout.
        costs: weighted value of each cost by name.
        outputs: the problem's reported quantities by name and unit.
        checks: targets, constraints and the goal.
        z: the variables by name.
        iterations: of the solver.
        counts: evaluations by kind.
        price: measured cost of one evaluation by kind, in rollouts.
        equivalents: the cost of all evaluations in rollouts.
        seconds: wall time of "build", "compile", "solve" and, in newer files, "judge"; what a solver loads beforehand
            is in none of them.
        trust: how far the solution can be trusted, with the keys of ``symphys.findings.examination``; without an
            examination what ``symphys.verification.survey`` measures.
        guess: of the start, exactly: "objective", "worst", the largest error / tolerance, and outputs, by "output: "
            and their names.
        stages: those of smoothing that were begun, in their order; the solution is the point of the last, unless that
            of another or the guess is better exactly.
        versions: of everything that took part.
        provenance: the machine, the process and the working copy, with the keys of ``symphys.runs.provenance``,
            "flags", those of the compiler, where something was compiled, "chosen", why the solver was taken where none
            was named, and "guess", the run from which it starts.
        when: UTC time of the end, ISO 8601.
        command: the command line.
        backend: the evaluator of the functions.
        verdict: a word of ``symphys.findings.verdict``.
        doubts: why the motion is not to be relied on, one clause each.
        again: whether what failed was the machine and not the run: the same command tries it again.
        absent: names of the fields above that the run did not reach; they are null in the file.
    """

    problem: str
    title: str
    solver: str
    seed: int
    solved: bool
    status: str
    advice: str
    objective: float = np.nan
    costs: Mapping[str, float] = field(default_factory=dict)
    outputs: Mapping[str, float] = field(default_factory=dict)
    checks: tuple[CheckRecord, ...] = ()
    z: Mapping[str, VariableRecord] = field(default_factory=dict)
    iterations: float = np.nan
    counts: Mapping[str, float] = field(default_factory=dict)
    price: Mapping[str, float] = field(default_factory=dict)
    equivalents: float = field(default=np.nan, metadata={"label": "Work [rollouts]", "decimals": 1})
    seconds: Mapping[str, float] = field(default_factory=dict)
    trust: Mapping[str, Any] = field(default_factory=dict)
    guess: Mapping[str, float] = field(default_factory=dict)
    stages: tuple[StageRecord, ...] = ()
    versions: Mapping[str, str] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    when: str = ""
    command: str = ""
    backend: BackendRecord = field(default_factory=BackendRecord)
    verdict: str = NOT_SOLVED
    doubts: tuple[str, ...] = ()
    again: bool = False
    absent: frozenset[str] = frozenset()

    def __eq__(self, other: object) -> bool:
        """Whether the files would be the same."""
        return isinstance(other, Result) and files.strict(self.to_json()) == files.strict(other.to_json())

    @property
    def interrupted(self) -> bool:
        """Whether the same command would resume it."""
        return self.status == "interrupted"

    @property
    def accepted(self) -> bool:
        """Whether the run achieved its aim: solved, or the best found if there is nothing to meet."""
        return self.verdict in ACCEPTED

    @property
    def worst(self) -> float | None:
        """The largest ratio of the checks, nan if one is nan: all are met at 1 or below. None without any."""
        ratios = [check.ratio for check in self.checks]
        return max(ratios, key=lambda ratio: math.inf if math.isnan(ratio) else ratio, default=None)

    @property
    def worst_ratio(self) -> float:
        """The largest ratio of the checks, inf if one is nan; nan without any."""
        worst = math.nan if self.worst is None else self.worst
        return math.inf if self.checks and math.isnan(worst) else worst

    def judge(self, met: bool) -> Judged:
        """Return the judgement of the exact rollout; ``met``: whether nothing is missed."""
        goal = any(check.kind == "goal" for check in self.checks)
        costs = np.nan if goal else sum(self.costs.values())
        return Judged(self.objective, self.worst_ratio, met, bool(self.checks), costs)

    def to_json(self) -> dict[str, Any]:
        """Return the object of result.json."""
        found: dict[str, Any] = {"format": FORMAT}
        for each in dataclasses.fields(Result):
            found[each.name] = getattr(self, each.name)
        del found["absent"]
        found["checks"] = [dataclasses.asdict(check) for check in self.checks]
        found["z"] = {name: variable.to_json() for name, variable in self.z.items()}
        found["stages"] = [dataclasses.asdict(stage) for stage in self.stages]
        found["backend"] = dataclasses.asdict(self.backend) if self.backend.name else {}
        found["doubts"] = list(self.doubts)
        return found | dict.fromkeys(self.absent)

    @classmethod
    def from_json(cls, value: object, text: Text = values.name, **given: Any) -> Self:
        """Read the result in an object of result.json, as far as it can be read; ``given``: fields known already.

        A file that is older than verdicts, whose ``solved`` means that everything is met, is judged anew.
        """
        entry = value if isinstance(value, dict) else {}
        read = values.record(
            cls,
            value,
            text,
            absent=frozenset(key for key in REACHED & entry.keys() if entry[key] is None),
            guess={renamed(key): number for key, number in values.measures(entry.get("guess")).items()},
            **{"verdict": text(entry.get("verdict")), **given},
        )
        named = {name: dataclasses.replace(each, name=name) for name, each in read.z.items()}
        read = dataclasses.replace(read, z=named)
        if read.verdict:
            return read
        met = everything_met(entry, read)
        return dataclasses.replace(
            read, **verdict_fields(judge_run(read.status, read.judge(met), values.table(entry.get("trust"))))
        )


def everything_met(entry: Mapping[str, object], result: Result) -> bool:
    """Whether the file says that nothing is missed; older files say so by ``solved``."""
    return all(check.met for check in result.checks) and ("verdict" in entry or entry.get("solved") is True)


def verdict_fields(verdict: Verdict) -> dict[str, Any]:
    """Return the fields of a result that hold a verdict."""
    return {"solved": verdict.solved, "verdict": verdict.word, "doubts": verdict.doubts}


def read_result(path: Path) -> Result:
    """Read the result in a file of this program's own; FileError, which names the file, if there is none."""
    try:
        value = files.read_json(path)
        if not isinstance(value, Mapping) or value.get("format") != FORMAT:
            raise files.FileError(f"not a result of format {FORMAT}")
        known = {each.name for each in dataclasses.fields(Result)} - {"absent"}
        if missing := known - ADDED_LATER - value.keys():
            raise files.FileError(f"a result without {', '.join(sorted(missing))}")
    except files.FileError as error:
        raise files.FileError(f"{path}: {error}") from error
    return Result.from_json(value, values.verbatim)


def smoothed(stages: Iterable[StageRecord]) -> bool:
    """Whether the solver used smoothed contact."""
    return any(stage.smoothing > 0 for stage in stages)
