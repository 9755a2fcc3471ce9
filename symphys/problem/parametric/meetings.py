"""Whether steps may find the pairs that are near by themselves, so that no list of all pairs is made."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import combinations_with_replacement
from typing import Any, Protocol

from symphys.model.shapes import Box, Capsule, Plane, Sphere
from symphys.model.world import UNEQUAL, Law
from symphys.problem.parametric.collision_filter import CollisionFilter
from symphys.problem.parametric.joints import ParametricJoint
from symphys.problem.parametric.parts import PairRule, ParametricBody, ParametricStatic, Part

MOST_POINTS = 2000
"""Points of contact of a world that are listed, and all looked at in every step."""


class MeetingParts(Protocol):
    """What of a ``ParametricWorld`` says who may meet whom."""

    @property
    def bodies(self) -> tuple[ParametricBody, ...]:
        """In the file's order."""

    @property
    def statics(self) -> tuple[ParametricStatic, ...]:
        """Likewise."""

    @property
    def parts(self) -> tuple[Part, ...]:
        """Bodies, then statics."""

    @property
    def joints(self) -> tuple[ParametricJoint, ...]:
        """In the file's order."""

    @property
    def pairs(self) -> tuple[PairRule, ...]:
        """Of [[pair]] tables."""

    @property
    def jointed(self) -> tuple[PairRule, ...]:
        """Those of bodies that joints hold together."""

    def parameters(self) -> Mapping[str, Any]:
        """Names and values."""

    def law(self, a: str, b: str, value: Callable[[str], Any]) -> Law:
        """Of two parts by name."""


def found_anew(world: MeetingParts) -> bool:
    """Whether a world has so many points of contact that steps find them, and is one in which they can."""
    candidates = CollisionFilter(world.parts, (*world.pairs, *world.jointed))
    return candidates.count(MOST_POINTS).points > MOST_POINTS and hindrance(world) is None


def hindrance(world: MeetingParts) -> str | None:
    """Why steps cannot find the pairs of a world, in a clause; None if they can."""
    return next(_hindrances(world), None)


def law_of_all(world: MeetingParts) -> Law | None:
    """The law of all contacts; None if there are several."""
    kinds: dict[object, str] = {}
    for part in world.parts:
        kinds.setdefault((isinstance(part, ParametricStatic), tuple(sorted(part.states.items()))), part.name)
    statics = {part.name for part in world.statics}
    laws = {
        world.law(a, b, lambda name: float(world.parameters()[name][0]))
        for a, b in combinations_with_replacement(kinds.values(), 2)
        if not {a, b} <= statics
    }
    return laws.pop() if len(laws) == 1 else None


def _hindrances(world: MeetingParts) -> Iterator[str]:
    yield from (f"there is a joint, {joint.name}" for joint in world.joints[:1])
    yield from (f"there is a [[pair]], {pair.name}" for pair in world.pairs[:1])
    yield from (f"{part.name} has collides_with" for part in world.parts if part.collides_with is not None)
    yield from (f"{each.name} is no plane" for each in world.statics if not isinstance(each.static, Plane))
    yield from (f"{body.name} is no sphere, capsule or box" for body in world.bodies if not _simple(body))
    masses = {body.name: body.mass for body in world.bodies}
    least, most = min(masses, key=masses.__getitem__), max(masses, key=masses.__getitem__)
    if masses[most] > UNEQUAL * masses[least]:
        yield f"{most} has more than {UNEQUAL:g} times the mass of {least}"
    if law_of_all(world) is None:
        yield "contacts have different laws"


def _simple(body: ParametricBody) -> bool:
    """Whether it is one of the shapes for which such steps were compared with those of a list."""
    return bool(body.mass) and len(body.shapes) == 1 and isinstance(body.shapes[0], Sphere | Capsule | Box)
