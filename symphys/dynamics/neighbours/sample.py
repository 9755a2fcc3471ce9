"""A few bodies that stand for many equal ones: two of each species, and a pair of each kind."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace

from symphys.model.body import Body
from symphys.model.world import Law, Pair, Side, World, points_of

TWINS = 2
"""Bodies of a species in the sample."""


@dataclass(frozen=True)
class PairKind:
    """Pairs of bodies of two species, or of one and a plane.

    Attributes:
        first: number of the species of the first body.
        second: the same of the second; None: a plane.
        plane: index of the static surface; -1: none.
    """

    first: int
    second: int | None
    plane: int = -1


@dataclass(frozen=True)
class Sample:
    """The world of the few.

    Attributes:
        world: two bodies of each species, one after the other, and pairs.
        species: of each species the indices of its bodies in the whole world.
        kinds: of pairs.
        pairs: of each kind the indices of its pairs in ``world`` that stand for it.
    """

    world: World
    species: tuple[tuple[int, ...], ...]
    kinds: tuple[PairKind, ...]
    pairs: tuple[tuple[int, ...], ...]


def sample_of(world: World, law: Law) -> Sample:
    """Of a world of bodies without joints that are known in numbers, on planes. All touch all, with one law."""
    found: dict[Hashable, list[int]] = {}
    for index, body in enumerate(world.bodies):
        found.setdefault(_kind(body), []).append(index)
    species = tuple(map(tuple, found.values()))
    bodies = [
        replace(world.bodies[own[0]], name=f"{'ab'[k]}{number}") for number, own in enumerate(species) for k in range(2)
    ]
    kinds = [PairKind(s, None, k) for s in range(len(species)) for k in range(len(world.statics))]
    meet = [(s, t) for s, own in enumerate(species) for t in range(s, len(species)) if s < t or len(own) > 1]
    kinds += [PairKind(s, t) for s, t in meet]
    pairs, of_kind = list[Pair](), list[tuple[int, ...]]()
    for kind in kinds:
        sides = [_sides(bodies, kind, twin) for twin in range(TWINS)]
        begin = len(pairs)
        for which, (a, b) in enumerate(sides):
            for first in a:
                for second in b:
                    pairs += points_of(bodies, world.statics, first, second, law)
            if which == 0:
                of_kind.append(tuple(range(begin, len(pairs))))
    return Sample(
        replace(world, bodies=tuple(bodies), pairs=tuple(pairs), sites=()), species, tuple(kinds), tuple(of_kind)
    )


def _sides(bodies: list[Body], kind: PairKind, twin: int) -> tuple[list[Side], list[Side]]:
    first = TWINS * kind.first + twin
    a = [Side(first, k) for k in range(len(bodies[first].shapes))]
    if kind.second is None:
        return a, [Side(None, kind.plane)]
    second = TWINS * kind.second + (1 - twin if kind.first == kind.second else twin)
    return a, [Side(second, k) for k in range(len(bodies[second].shapes))]


def _kind(body: Body) -> Hashable:
    return repr((body.mass, body.inertia, body.shapes))
