"""Collision: one file a pair of shapes, each returning the same ``Contact``."""

from __future__ import annotations

from collections.abc import Sequence

from symphys.collide.contact import Contact
from symphys.collide.sphere_plane import sphere_plane
from symphys.collide.sphere_sphere import sphere_sphere
from symphys.motion import Motion
from symphys.shapes import Plane, Sphere
from symphys.world import Pair, World

__all__ = ["Contact", "collide"]


def collide(world: World, pair: Pair, motions: Sequence[Motion]) -> Contact:
    """The contact of one pair in this step."""
    first, second = pair.first, pair.second
    if first.body is None:
        raise ValueError(f"pair {pair.name!r}: the first side must belong to a body")
    motion, shape, other = motions[first.body], world.surface(first), world.surface(second)
    assert isinstance(shape, Sphere)
    if second.body is None:
        assert isinstance(other, Plane)
        return sphere_plane(pair, motion, shape, other)
    assert isinstance(other, Sphere)
    return sphere_sphere(pair, (motion, motions[second.body]), (shape, other))
