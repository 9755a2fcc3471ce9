"""Collision: one file a pair of shapes; all return the same ``Contact``, one for each point of the pair."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from symphys.dynamics.collision.contact_geometry import Contact, flipped
from symphys.dynamics.collision.fields.convex import sphere_convex
from symphys.dynamics.collision.fields.cylinder import capsule_cylinder, sphere_cylinder
from symphys.dynamics.collision.fields.ellipsoid import capsule_ellipsoid, sphere_ellipsoid
from symphys.dynamics.collision.half_space import box_plane, capsule_plane, sphere_plane
from symphys.dynamics.collision.pairs.box_box import box_box
from symphys.dynamics.collision.pairs.capsule_box import capsule_box
from symphys.dynamics.collision.pairs.capsule_capsule import capsule_capsule
from symphys.dynamics.collision.pairs.convex_ground import convex_plane, convex_terrain
from symphys.dynamics.collision.pairs.cylinder_ground import cylinder_plane, cylinder_terrain
from symphys.dynamics.collision.pairs.ellipsoid_ground import ellipsoid_plane, ellipsoid_terrain
from symphys.dynamics.collision.pairs.solid_solid import solid_solid
from symphys.dynamics.collision.pairs.sphere_box import sphere_box
from symphys.dynamics.collision.pairs.sphere_capsule import sphere_capsule
from symphys.dynamics.collision.pairs.sphere_sphere import sphere_sphere
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.collision.terrain import box_terrain, capsule_terrain, sphere_terrain
from symphys.dynamics.tracing.decorator import traced
from symphys.model.shapes import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    Plane,
    Sphere,
    Surface,
    Terrain,
    points_of_kinds,
)

__all__ = ["Contact", "collide"]

Rule = Callable[[Any, Any, PredictedPath, PredictedPath], list[Contact]]

RULES: dict[tuple[type, type], Rule] = {
    (Sphere, Plane): sphere_plane,
    (Capsule, Plane): capsule_plane,
    (Box, Plane): box_plane,
    (Sphere, Terrain): sphere_terrain,
    (Capsule, Terrain): capsule_terrain,
    (Box, Terrain): box_terrain,
    (Cylinder, Plane): cylinder_plane,
    (Ellipsoid, Plane): ellipsoid_plane,
    (Convex, Plane): convex_plane,
    (Cylinder, Terrain): cylinder_terrain,
    (Ellipsoid, Terrain): ellipsoid_terrain,
    (Convex, Terrain): convex_terrain,
    (Sphere, Sphere): sphere_sphere,
    (Sphere, Capsule): sphere_capsule,
    (Sphere, Box): sphere_box,
    (Capsule, Capsule): capsule_capsule,
    (Capsule, Box): capsule_box,
    (Box, Box): box_box,
    (Sphere, Cylinder): sphere_cylinder,
    (Sphere, Ellipsoid): sphere_ellipsoid,
    (Sphere, Convex): sphere_convex,
    (Capsule, Cylinder): capsule_cylinder,
    (Capsule, Ellipsoid): capsule_ellipsoid,
    (Capsule, Convex): solid_solid,
    (Box, Cylinder): solid_solid,
    (Box, Convex): solid_solid,
    (Convex, Cylinder): solid_solid,
    (Convex, Convex): solid_solid,
    (Cylinder, Cylinder): solid_solid,
}
"""The rule of each pair of surfaces; ``shapes.POINTS`` says how many points each returns."""


SEPARATE_POINTS = frozenset({(Capsule, Plane), (Box, Plane), (Capsule, Capsule)})
"""Pairs whose points have little in common: each is computed by itself, so that it may be far by itself."""


IN_PARTS = frozenset({(Box, Box)} | {kinds for kinds, rule in RULES.items() if rule is solid_solid})
"""Pairs whose rules call traced functions."""


def collide(first: Surface, second: Surface, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """Return the contacts of two surfaces, carried along a and b, in this step: one for each point."""
    kinds = type(first), type(second)
    if kinds in IN_PARTS:
        return RULES[kinds](first, second, a, b)
    if kinds[::-1] in IN_PARTS:
        return [flipped(contact) for contact in RULES[kinds[::-1]](second, first, b, a)]
    if kinds in SEPARATE_POINTS:
        return [_point(k, first, second, a, b) for k in range(points_of_kinds(*kinds))]
    return _points(first, second, a, b)


@traced
def _point(k: int, first: Surface, second: Surface, a: PredictedPath, b: PredictedPath) -> Contact:
    return RULES[type(first), type(second)](first, second, a, b)[k]


@traced
def _points(first: Surface, second: Surface, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    rule = RULES.get((type(first), type(second)))
    if rule is not None:
        return rule(first, second, a, b)
    return [flipped(contact) for contact in RULES[type(second), type(first)](second, first, b, a)]
