"""The collision filter: which parts of a world may touch which, counted and listed by classes of equal parts.

Parts are of one class if no rule of the file distinguishes them. Tens of thousands of bodies are a few classes, so
that their pairs are counted without a loop over all pairs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import field
from functools import cached_property

import numpy as np

from symphys.model.shapes import SURFACES, points_of_kinds
from symphys.problem.parametric.parts import PairRule, ParametricBody, Part
from symphys.records import dataclass
from symphys.types import Bools, Ints

KINDS = tuple(SURFACES.values())
"""All kinds of surfaces."""
MIN_COUNTED_CLASSES = 256
"""Where there are more classes than this and already too many points, the rest need not be counted."""


@dataclass(frozen=True)
class BodyClass:
    """Parts (bodies, or static surfaces) with the same shapes that may touch the same others.

    Attributes:
        part: the first of them.
        members: their places among all parts.
        surfaces: (kinds,) how many surfaces of each kind one of them has.
    """

    part: Part
    members: list[int]
    surfaces: Ints

    @property
    def moves(self) -> bool:
        """Whether they are bodies."""
        return isinstance(self.part, ParametricBody)


@dataclass
class PairCount:
    """The number of contact points to compute.

    Attributes:
        points: how many are computed in every step.
        whole: whether all were counted.
        shares: points by the two sets of parts that they are between, as places in ``CollisionFilter.sets``.
        uncovered: (a, b) examples of parts that may touch with surfaces that no rule covers.
    """

    points: int = 0
    whole: bool = True
    shares: Counter[tuple[int, int]] = field(default_factory=Counter)
    uncovered: list[tuple[str, str]] = field(default_factory=list)

    def add(self, one: int, others: Ints, counts: Ints) -> None:
        """Add points to the shares of a set with others."""
        sums = np.bincount(others, weights=counts)
        self.shares.update({(one, other): int(sums[other]) for other in np.flatnonzero(sums).tolist()})


class CollisionFilter:
    """The parts of a world, bodies first, and which of them may touch."""

    def __init__(self, parts: Sequence[Part], tables: Sequence[PairRule]) -> None:
        """Sort the parts into classes."""
        self.parts, self.tables = parts, tables
        mentioned = {name for part in parts for name in part.collides_with or ()}
        mentioned |= {name for table in tables for name in table.between}
        found: dict[object, list[int]] = {}
        for index, part in enumerate(parts):
            own = part.name if part.name in mentioned else None
            key = (kinds(part), isinstance(part, ParametricBody), part.group, part.collides_with, own)
            found.setdefault(key, []).append(index)
        self.classes = [BodyClass(parts[m[0]], m, np.array(kinds(parts[m[0]]), np.int64)) for m in found.values()]
        self.sets: dict[object, list[BodyClass]] = {}
        for each in self.classes:
            self.sets.setdefault((kinds(each.part), each.moves, each.part.group), []).append(each)

    def count(self, most: int) -> PairCount:
        """Count the points; beyond ``most`` the count may stop early."""
        found = PairCount()
        numbers = np.array([len(each.members) for each in self.classes])
        surfaces = np.array([each.surfaces for each in self.classes])
        points = np.array([[points_of_kinds(a, b) for b in KINDS] for a in KINDS])
        missing = (points == 0).astype(np.int64)
        places = {id(each): place for place, members in enumerate(self.sets.values()) for each in members}
        place = np.array([places[id(each)] for each in self.classes])
        for c, met in self._rows():
            pairs = numbers[c] * numbers[met]
            pairs[met == c] = numbers[c] * (numbers[c] - 1) // 2
            counts = pairs * (surfaces[met] @ (points @ surfaces[c]))
            found.points += int(counts.sum())
            found.add(int(place[c]), place[met], counts)
            bare = (pairs > 0) & (surfaces[met] @ (missing @ surfaces[c]) > 0)
            found.uncovered += [self._example(c, int(d)) for d in met[bare]]
            if found.points > most and c >= MIN_COUNTED_CLASSES:
                found.whole = False
                break
        return found

    def pairs(self) -> list[tuple[int, int]]:
        """Return every two parts that may touch and have surfaces, as places among the parts, in their order."""
        found = []
        for c, met in self._rows():
            for d in met.tolist():
                if not (self.classes[c].surfaces.any() and self.classes[d].surfaces.any()):
                    continue
                both = ((i, j) for i in self.classes[c].members for j in self.classes[d].members)
                found += [(min(i, j), max(i, j)) for i, j in both if d != c or i < j]
        return sorted(found)

    def _example(self, c: int, d: int) -> tuple[str, str]:
        return self.classes[c].part.name, self.parts[self.classes[d].members[-1]].name

    def _rows(self) -> Iterator[tuple[int, Ints]]:
        """Return for each class of bodies which later classes, static ones and itself it may touch."""
        for c, each in enumerate(self.classes):
            if each.moves:
                met = np.flatnonzero(self._lets(c) & self._let(c) & self._collide(c))
                yield c, met[met >= c]

    def _lets(self, c: int) -> Bools:
        """Return the classes that ``c`` lists in collides_with."""
        named = self.classes[c].part.collides_with
        if named is None:
            return np.ones(len(self.classes), bool)
        mask = np.zeros(len(self.classes), bool)
        for name in named:
            mask[self._named.get(name, [])] = True
        return mask

    def _let(self, c: int) -> Bools:
        """Return the classes that list ``c`` in collides_with."""
        mask = self._free.copy()
        for name in own_names(self.classes[c].part):
            mask[self._wanted.get(name, [])] = True
        return mask

    def _collide(self, c: int) -> Bools:
        """Return the classes with which [[pair]] tables let ``c`` collide; tables that name more surfaces win."""
        mask = np.ones(len(self.classes), bool)
        own = own_names(self.classes[c].part)
        for place in sorted({place for name in own for place in self._stated.get(name, [])}):
            _, a, b, collide = self._ranked[place]
            for mine, other in ((a, b), (b, a)):
                if mine in own:
                    mask[self._named.get(other, [])] = collide
        return mask

    @cached_property
    def _ranked(self) -> list[tuple[int, str, str, bool]]:
        """(how many surfaces it names, the two names, collide) of each [[pair]] table, by the first."""
        names = {part.name for part in self.parts}
        rows = [(len(names & table.between), min(table.between), max(table.between), table) for table in self.tables]
        return [(rank, a, b, table.collide) for rank, a, b, table in sorted(rows, key=lambda row: row[0])]

    @cached_property
    def _stated(self) -> dict[str, list[int]]:
        """The tables, as places in ``_ranked``, that have a name or a group."""
        return gather((name, place) for place, (_, a, b, _) in enumerate(self._ranked) for name in {a, b})

    @cached_property
    def _named(self) -> dict[str, list[int]]:
        """The classes that a name or a group means."""
        return gather((name, c) for c, each in enumerate(self.classes) for name in own_names(each.part))

    @cached_property
    def _wanted(self) -> dict[str, list[int]]:
        """The classes that list a name or group in collides_with."""
        return gather((name, c) for c, each in enumerate(self.classes) for name in each.part.collides_with or ())

    @cached_property
    def _free(self) -> Bools:
        return np.array([each.part.collides_with is None for each in self.classes])


def kinds(part: Part) -> tuple[int, ...]:
    """(kinds,) how many surfaces of each kind a part has."""
    counts = Counter(type(surface) for surface in part.surfaces)
    return tuple(counts[kind] for kind in KINDS)


def own_names(part: Part) -> tuple[str, ...]:
    """Return the names of a part in collides_with and [[pair]]: its own and its group's."""
    return (part.name,) if part.group is None else (part.name, part.group)


def gather(entries: Iterable[tuple[str, int]]) -> dict[str, list[int]]:
    """The numbers that belong to each name."""
    found: dict[str, list[int]] = {}
    for name, number in entries:
        found.setdefault(name, []).append(number)
    return found
