"""The points of a sweep as problems: what is swept is settled first, then each point is read and validated.

Ten thousand problems of a robot would take gigabytes. What a list of runs asks of each (name, settings, identity,
solvers) is kept, about a kilobyte; the text is shared, and the rest is read again where it is needed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from symphys import files
from symphys.errors import Issue, ProblemError
from symphys.problem.model import Simulation
from symphys.problem.parametric.parts import DISTRIBUTION
from symphys.problem.problem import Problem, plain
from symphys.problem.reader import ProblemReader
from symphys.problem.recordings.files import without_places
from symphys.problem.sweeps.sweep import GRID, Axis, Samples, Sweep, SweepError
from symphys.types import Array

KEPT = (
    "name",
    "title",
    "file",
    "text",
    "settings",
    "functions",
    "simulation",
    "initial",
    "scenarios",
    "solvers",
    "solver_tables",
)
"""Fields of a problem that a lazy one has itself."""


class Family:
    """Problems of one file that differ in their settings.

    Attributes:
        settings: those that all of them have.
        varied: names of the parameters in which those that were read so far differ.
    """

    def __init__(self, problem: Problem) -> None:
        """Start from a problem whose settings all points share."""
        self.name, self.file, self.text = problem.name, problem.file, problem.text
        self.settings = dict(problem.settings)
        self.functions = dict(problem.functions)
        self.varied: set[str] = set()
        self.first = dict(problem.parameters)
        self._begin()

    def _begin(self) -> None:
        self._reader: ProblemReader | None = None
        self._last: tuple[str, Problem] | None = None
        self._simulation: Simulation | None = None
        self._initial: dict[str, Array] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Return the state to pickle: nothing that can be rebuilt."""
        return {key: value for key, value in vars(self).items() if not key.startswith("_")} | {"first": {}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Arrive in another process."""
        vars(self).update(state)
        self._begin()

    @property
    def reader(self) -> ProblemReader:
        """Reads problems of the family; families of one text that come one after the other share one."""
        if self.functions:
            self._reader = self._reader or ProblemReader(Path(self.file), self.text, self.functions)
            return self._reader
        return reader_of(self.file, self.text)

    def problem(self, settings: Mapping[str, object]) -> Problem:
        """The whole problem under these settings; that of the last call is kept."""
        asked = repr(settings)  # 1 and true are not the same
        if self._last is None or self._last[0] != asked:
            data = self.reader.read(settings)
            fields = {**vars(data), "name": self.name, "sweep": None}
            self._last = asked, Problem(**fields, settings=settings, functions=self.functions)
        return self._last[1]

    def note(self, whole: Problem) -> None:
        """Find the parameters in which a problem differs from the base, except those that follow from others."""
        for name, value in whole.parameters.items():
            if name.rpartition(".")[2] in DISTRIBUTION:
                continue
            if name not in self.varied and not np.array_equal(value, self.first.get(name, value)):
                self.varied.add(name)

    def shared(self, whole: Problem) -> dict[str, Any]:
        """Simulation and initial state of a problem; one object for all neighbours that have them equal."""
        if self._simulation != whole.simulation:
            self._simulation = whole.simulation
        if stacked(self._initial) != stacked(whole.initial):
            self._initial = whole.initial
        return {"simulation": self._simulation, "initial": self._initial}


def stacked(values: Mapping[str, Array]) -> bytes:
    """Return the bytes of all numbers of these arrays."""
    return b"".join(value.tobytes() for value in values.values())


@lru_cache(maxsize=2)
def reader_of(file: str, text: str) -> ProblemReader:
    """A reader of a text, which is parsed once in each process."""
    return ProblemReader(Path(file), text)


class LazyProblem(Problem):
    """A problem that is read where more than its name, settings, solvers and simulation is asked for.

    It is a ``Problem`` in all respects; what ``dataclasses.replace`` makes of it is a whole one. One whole problem of a
    family is in memory at a time.
    """

    def __new__(cls, family: Family | None = None, whole: Problem | None = None, **fields: Any) -> Any:
        """Keep what lists of runs ask of a problem; made from fields alone, as by ``replace``, it is whole."""
        return object.__new__(cls) if family is not None else Problem(**fields)

    def __init__(self, family: Family, whole: Problem) -> None:
        """Keep the facts of a problem that was read."""
        family.note(whole)
        vars(self).update({key: getattr(whole, key) for key in KEPT})
        digest = hashlib.sha256(stacked(whole.weights)).hexdigest() if whole.controllers else ""
        vars(self).update(family.shared(whole), _family=family, _digest=digest)

    def __reduce__(self) -> tuple[Any, ...]:
        """Travels to other processes as what is kept."""
        return arrived, (dict(vars(self)),)

    @property
    def whole(self) -> Problem:
        """The problem, read."""
        family: Family = vars(self)["_family"]
        return family.problem(self.settings)

    @property
    def varied(self) -> frozenset[str]:
        """Known when all problems of the sweep were read."""
        family: Family = vars(self)["_family"]
        return frozenset(family.varied)

    @property
    def identity(self) -> str:
        """Return the identity of the problem without reading it again."""
        digest: str = vars(self)["_digest"]
        text = without_places(self.text)
        return f"{text}\n{digest}" if digest else text


def arrived(state: dict[str, Any]) -> LazyProblem:
    """A lazy problem with what is kept of it."""
    made: LazyProblem = object.__new__(LazyProblem)
    vars(made).update(state)
    return made


def _read(name: str) -> property:
    return property(lambda self: getattr(self.whole, name))


for _field in fields(Problem):
    if _field.name not in (*KEPT, "varied"):
        setattr(LazyProblem, _field.name, _read(_field.name))


Place = tuple[str | int, ...]


def combined(own: Sweep | None, problem: Problem, axes: Sequence[Axis] = (), samples: Samples | None = None) -> Sweep:
    """Combine the sweep of a problem with axes that replace or extend its own, and with other samples.

    Args:
        own: as the problem's file has it; None for none.
        problem: whose keys are swept.
        axes: each stands in place of the own axis of the same key, however the key is written.
        samples: in place of its own.

    Raises:
        SweepError: two axes, or an axis and a setting of the problem, change the same value.
    """
    reader = reader_of(problem.file, problem.text)
    given = [(axis, reader.place(axis.key)) for axis in axes]
    found = [(axis, reader.place(axis.key)) for axis in (own.axes if own else ())]
    kept = [replacing(axis, place, given) for axis, place in found]
    places = {place for _, place in kept}
    every = [*kept, *((axis, place) for axis, place in given if place not in places)]
    for index, (axis, place) in enumerate(every):
        for other, there in every[:index]:
            if overlap(place, there):
                raise SweepError(f"{other.key} and {axis.key} change the same value; sweep one of the two")
        for key in problem.settings:
            if overlap(place, reader.place(key)):
                raise SweepError(by_both(key, axis, own, axes))
    sweep = Sweep(tuple(axis for axis, _ in every), samples or (own.samples if own else GRID))
    sweep.check()
    return sweep


def replacing(axis: Axis, place: Place, given: Sequence[tuple[Axis, Place]]) -> tuple[Axis, Place]:
    """The axis, or what was given in its place."""
    return next(((other, there) for other, there in given if there == place), (axis, place))


def overlap(one: Place, other: Place) -> bool:
    """Whether one of the two places is the other, or in it."""
    count = min(len(one), len(other))
    return one[:count] == other[:count]


def by_both(key: str, axis: Axis, own: Sweep | None, axes: Sequence[Axis]) -> str:
    """Return the message for a key that both a setting and a sweep give."""
    text = f"{key} is set to one value (--set), and swept"
    if axis in axes or own is None:
        return f"{text}; leave one of the two out"
    return f"{text} by [sweep] of the file; --sweep {axis.key}=VALUE sweeps that value alone, --sweep none nothing"


def swept(problem: Problem, sweep: Sweep, tell: Callable[[], None] | None = None) -> Iterator[Problem]:
    """Yield each point as a problem with settings, validated when it is asked for, and read again where it is used.

    Args:
        problem: whose settings all points have.
        sweep: of its keys.
        tell: is called after each point.

    Raises:
        ProblemError: a point that cannot be; the message names it.
    """
    family = Family(problem)
    for point in sweep.points():
        settings = plain({**problem.settings, **point})
        try:
            whole = family.problem(settings)
        except ProblemError as error:
            raise ProblemError(error.file, [of_point(issue, point) for issue in error.issues]) from None
        if tell is not None:
            tell()
        yield LazyProblem(family, whole)


def of_point(issue: Issue, point: Mapping[str, object]) -> Issue:
    """A fault, with the point of the sweep that has it."""
    words = ", ".join(f"{key}={json.dumps(files.strict(value))}" for key, value in point.items())
    return Issue(issue.where, f"{issue.message} (at the point {words} of the sweep)", issue.file)
