"""Collision: one file a pair of shapes; all return the same ``Contact``, one for each point of the pair."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from symphys.dynamics.collision.contact_geometry import Contact, flipped
from symphys.dynamics.collision.pairs.box_box import box_box
from symphys.dynamics.collision.pairs.box_plane import box_plane
from symphys.dynamics.collision.pairs.capsule_box import capsule_box
from symphys.dynamics.collision.pairs.capsule_capsule import capsule_capsule
from symphys.dynamics.collision.pairs.capsule_plane import capsule_plane
from symphys.dynamics.collision.pairs.sphere_box import sphere_box
from symphys.dynamics.collision.pairs.sphere_capsule import sphere_capsule
from symphys.dynamics.collision.pairs.sphere_plane import sphere_plane
from symphys.dynamics.collision.pairs.sphere_sphere import sphere_sphere
from symphys.dynamics.collision.pairs.terrain import box_terrain, capsule_terrain, sphere_terrain
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.tracing.decorator import traced
from symphys.model.shapes import Box, Capsule, Plane, Sphere, Surface, Terrain

__all__ = ["Contact", "collide"]

Rule = Callable[[Any, Any, PredictedPath, PredictedPath], list[Contact]]

RULES: dict[tuple[type, type], Rule] = {
    (Sphere, Plane): sphere_plane,
    (Capsule, Plane): capsule_plane,
    (Box, Plane): box_plane,
    (Sphere, Terrain): sphere_terrain,
    (Capsule, Terrain): capsule_terrain,
    (Box, Terrain): box_terrain,
    (Sphere, Sphere): sphere_sphere,
    (Sphere, Capsule): sphere_capsule,
    (Sphere, Box): sphere_box,
    (Capsule, Capsule): capsule_capsule,
    (Capsule, Box): capsule_box,
    (Box, Box): box_box,
}
"""Which rule covers which surfaces; ``shapes.POINTS`` says how many points each returns."""


@traced
def collide(first: Surface, second: Surface, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """The contacts of two surfaces, carried along a and b, in this step: one for each point."""
    rule = RULES.get((type(first), type(second)))
    if rule is not None:
        return rule(first, second, a, b)
    return [flipped(contact) for contact in RULES[type(second), type(first)](second, first, b, a)]
