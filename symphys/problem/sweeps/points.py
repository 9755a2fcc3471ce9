"""The points of a sweep as problems: what is swept is settled first, then each point is read and validated."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence

from symphys import files
from symphys.errors import Issue, ProblemError
from symphys.problem.problem import Problem, plain
from symphys.problem.sweeps.axes import Axis, SweepError
from symphys.problem.sweeps.lazy import Family, LazyProblem, reader_of
from symphys.problem.sweeps.samples import GRID, Samples
from symphys.problem.sweeps.sweep import Sweep

Place = tuple[str | int, ...]


def combined(own: Sweep | None, problem: Problem, axes: Sequence[Axis] = (), samples: Samples | None = None) -> Sweep:
    """What is swept of a problem: its own sweep with some axes replaced or added, and other samples.

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
    """What to say of a key that has one value by a setting and several by a sweep."""
    text = f"{key} is set to one value (--set), and swept"
    if axis in axes or own is None:
        return f"{text}; leave one of the two out"
    return f"{text} by [sweep] of the file; --sweep {axis.key}=VALUE sweeps that value alone, --sweep none nothing"


def swept(problem: Problem, sweep: Sweep, tell: Callable[[], None] | None = None) -> Iterator[Problem]:
    """Each point as a problem with settings; it is validated when it is asked for, and read again where it is used.

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
