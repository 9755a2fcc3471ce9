"""A problem of a sweep: validated, then forgotten but for a few facts, and read again where the rest is needed.

Ten thousand problems of a robot would take gigabytes. What a list of runs asks of each (name, settings, identity,
solvers) is kept, about a kilobyte; the text is shared.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from symphys.problem.model import Simulation
from symphys.problem.parametric.parts import DISTRIBUTION
from symphys.problem.problem import Problem
from symphys.problem.reader import ProblemReader
from symphys.problem.recordings.kept import without_places
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
        """That of a problem, whose settings all others have too."""
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
        """What travels to other processes: nothing that can be made there."""
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
        """See in which parameters a problem differs from the one that all are made of, but for those that follow."""
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
    """All numbers of these arrays."""
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
        """From a problem that was read; from fields alone, as ``replace`` does it, a whole problem."""
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
        """As that of the problem, which need not be read for it."""
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
