"""The pair limit: no more points of contact than a time step can compute, and none without a rule."""

from __future__ import annotations

from collections.abc import Sequence

from symphys.model.shapes import SHAPES, SURFACES, SolidShape, Surface, points_of_kinds
from symphys.problem.parametric.collision_filter import BodyClass, CollisionFilter, PairCount
from symphys.problem.parametric.parts import ParametricBody
from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.reading.faults import Faults

LISTED = 3
MOST_POINTS = 2000
"""Points of contact of a world: all are looked at in every step."""


def check_pair_limit(world: ParametricWorld, faults: Faults) -> None:
    """Every point where two surfaces may touch is computed in every step."""
    candidates = CollisionFilter(world.parts, (*world.pairs, *world.jointed))
    counted = candidates.count(MOST_POINTS)
    if counted.points > MOST_POINTS:
        faults.stop(("body",), too_many(candidates, counted))
    if counted.uncovered:
        listed = ", ".join(f"{a} and {b}" for a, b in counted.uncovered[:LISTED])
        more = f" and {len(counted.uncovered) - LISTED} more" if len(counted.uncovered) > LISTED else ""
        faults.stop(
            ("body",),
            f"contact of such shapes is not known: {listed}{more}; let them pass through each other, by collides_with "
            "or by a [[pair]] with collide = false",
        )


def too_many(candidates: CollisionFilter, counted: PairCount) -> str:
    """Say how many contact points there are, where most come from, and what to do."""
    sets = list(candidates.sets.values())
    largest = counted.shares.most_common(LISTED)
    listed = ", ".join(f"{between(sets[a], sets[b], a == b)}: {count}" for (a, b), count in largest)
    count = f"{counted.points}" if counted.whole else f"more than {counted.points}"
    remedy = (
        "let fewer of them meet: give them a group, and say who touches whom by collides_with or by a [[pair]] with "
        "collide = false"
    )
    simplest = min(SHAPES.values(), key=most_points)
    solids = [solid for a, _ in counted.shares for solid in sets[a][0].part.surfaces if isinstance(solid, SolidShape)]
    others = sorted({solid.plural for solid in solids if most_points(type(solid)) > most_points(simplest)})
    if others:
        remedy += f"; or take {simplest.plural} in place of {' and '.join(others)}"
    return f"{count} points of contact in every step are too many, {MOST_POINTS} are allowed ({listed}); {remedy}"


def most_points(kind: type[Surface]) -> int:
    """Return the largest number of points in which a surface of this kind touches another."""
    return max(points_of_kinds(kind, other) for other in SURFACES.values())


def between(a: Sequence[BodyClass], b: Sequence[BodyClass], same: bool) -> str:
    """``40 boxes against each other``, ``40 boxes against ground``."""
    return f"{called(a)} against {'each other' if same else called(b)}"


def called(members: Sequence[BodyClass]) -> str:
    """A part by its name, several by their number and kind."""
    count, part = sum(len(each.members) for each in members), members[0].part
    if count == 1:
        return part.name
    if isinstance(part, ParametricBody):
        word = part.shapes[0].plural if len(part.shapes) == 1 else "compounds"
    else:
        word = part.static.plural
    return f"{count} {word} of {part.group}" if part.group else f"{count} {word}"
