"""What a run found: the fields of result.json."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypedDict

from symphys import files
from symphys.findings.levels import Judged
from symphys.findings.verdict import ACCEPTED, NOT_SOLVED, Ruling, rule

FORMAT = 1
MEASURES = ("error", "tolerance", "ratio")
JUDGED_LATE = {"verdict", "doubts"}
"""Fields that older files do not have."""


class CheckRecord(TypedDict):
    """One target, constraint or goal: ``error`` and ``tolerance`` in its own unit; met where ``ratio`` <= 1."""

    kind: str
    name: str
    error: float
    tolerance: float
    ratio: float
    met: bool


class BlockRecord(TypedDict):
    """One variable: ``shape`` (components, knots); the lists hold components * knots numbers, knot after knot."""

    sets: list[str]
    shape: list[int]
    value: list[float]
    guess: list[float]
    lower: list[float | None]
    upper: list[float | None]


class StageRecord(TypedDict):
    """One stage of smoothing, and its best point.

    ``objective`` and ``worst`` (largest error / tolerance) are those at this smoothing; ``exact_objective``,
    ``exact_worst`` and ``solved`` those of the exact rollout. ``counts``, ``equivalents`` and ``seconds`` are what the
    stage took, those before it left out; ``status`` is how it ended.
    """

    smoothing: float
    status: str
    objective: float
    worst: float
    exact_objective: float
    exact_worst: float
    solved: bool
    counts: dict[str, int]
    equivalents: float
    seconds: float


@dataclass(frozen=True)
class Result:
    """One solve, judged by the exact rollout at smoothing 0. What is not known is None.

    Attributes:
        problem, title: the file's stem and its title.
        solver, seed: who solved it, from which guess.
        solved: whether every check is met, or the point is stationary where there is none, by a motion that can be
            relied on; the same as a verdict of "solved".
        status, advice: how the solver ended and what to try.
        objective: of the exact rollout.
        costs: weighted value of each cost by name.
        outputs: what the problem tells, by name.
        checks: targets, constraints and the goal.
        z: the variables by name.
        iterations: of the solver.
        counts: evaluations by kind.
        price: measured cost of one evaluation by kind, in rollouts.
        equivalents: the whole work in rollouts.
        seconds: wall time of "build", "compile" and "solve"; what a solver loads beforehand is in none of them.
        trust: how far the solution can be trusted; without an examination what
            ``symphys.verification.survey`` says.
        guess: what the run started from, exactly: "objective", "worst", the largest error / tolerance, and what is
            told, by "told: " and its name.
        stages: those of smoothing that were begun, in their order; the solution is the point of the last, unless that
            of another or the guess is better exactly.
        versions: of everything that took part.
        when: UTC time of the end, ISO 8601.
        command: what was typed.
        backend: what evaluated: "name", "lanes", "threads", "precision", "compiler"; "compiled": "cold", "warm" (from
            the cache) or empty; "note": why it is not what was asked for, or empty.
        verdict: a word of ``symphys.findings.verdict``.
        doubts: why the motion is not to be relied on, one clause each.
    """

    problem: str
    title: str
    solver: str
    seed: int
    solved: bool
    status: str
    advice: str
    objective: float | None = None
    costs: dict[str, float] | None = None
    outputs: dict[str, float] | None = None
    checks: list[CheckRecord] | None = None
    z: dict[str, BlockRecord] | None = None
    iterations: int | None = None
    counts: dict[str, int] | None = None
    price: dict[str, float] | None = None
    equivalents: float | None = None
    seconds: dict[str, float] | None = None
    trust: dict[str, Any] | None = None
    guess: dict[str, float] | None = None
    stages: list[StageRecord] | None = None
    versions: dict[str, str] = field(default_factory=dict)
    when: str = ""
    command: str = ""
    backend: dict[str, Any] = field(default_factory=dict)
    verdict: str = NOT_SOLVED
    doubts: list[str] = field(default_factory=list)

    @property
    def interrupted(self) -> bool:
        """Whether the same command would go on with it."""
        return self.status == "interrupted"

    @property
    def accepted(self) -> bool:
        """Whether it did what was asked: solved, or the best was found of what has nothing to meet."""
        return self.verdict in ACCEPTED

    @property
    def worst(self) -> float | None:
        """Largest ratio of the checks, nan if one is nan: all are met at 1 or below. None without any."""
        ratios = [check["ratio"] for check in self.checks or ()]
        return max(ratios, key=lambda r: math.inf if math.isnan(r) else r, default=None)

    def to_json(self) -> dict[str, Any]:
        """The object of result.json."""
        return {"format": FORMAT, **dataclasses.asdict(self)}

    @classmethod
    def from_json(cls, value: Any) -> Result:
        """The result in an object of result.json; FileError if it is none, or of another format."""
        if not isinstance(value, Mapping) or value.get("format") != FORMAT:
            raise files.FileError(f"not a result of format {FORMAT}")
        known = {f.name for f in dataclasses.fields(cls)}
        if missing := known - JUDGED_LATE - value.keys():
            raise files.FileError(f"a result without {', '.join(sorted(missing))}")
        kept = {"problem", "title", "status", "advice", "checks", "backend", "verdict", "doubts"}
        fields = {key: value[key] if key in kept else files.numbers(value[key]) for key in known & value.keys()}
        if fields["checks"] is not None:
            fields["checks"] = [{**c, **files.numbers({k: c[k] for k in MEASURES})} for c in fields["checks"]]
        result = cls(**fields)
        return result if value.keys() >= JUDGED_LATE else result.judged_late()

    def judged_late(self) -> Result:
        """The result of a file that is older than verdicts, whose ``solved`` means that everything is met."""
        objective, worst = (math.nan if number is None else number for number in (self.objective, self.worst))
        judged = Judged(objective, worst, self.solved, bool(self.checks))
        return dataclasses.replace(self, **ruled(rule(self.status, judged, self.trust)))


def ruled(ruling: Ruling) -> dict[str, Any]:
    """The fields of a result that say what was ruled."""
    return {"solved": ruling.solved, "verdict": ruling.verdict, "doubts": list(ruling.doubts)}


def read_result(path: Path) -> Result:
    """The result in a file; FileError, which names the file, if there is none."""
    try:
        return Result.from_json(files.read_json(path))
    except files.FileError as error:
        raise files.FileError(f"{path}: {error}") from error
