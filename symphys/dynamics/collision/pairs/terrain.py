"""Spheres, capsules and boxes on a body against terrain: their round ends and corners touch it."""

from __future__ import annotations

from symphys.dynamics.collision.body_points import corners, ends
from symphys.dynamics.collision.contact_geometry import Contact
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.collision.terrain import ball_on_terrain
from symphys.model.shapes import Box, Capsule, Sphere, Terrain


def sphere_terrain(sphere: Sphere, terrain: Terrain, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """One point."""
    return [ball_on_terrain(sphere.centre, sphere.radius, terrain, a)]


def capsule_terrain(capsule: Capsule, terrain: Terrain, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Two points: the round ends."""
    return [ball_on_terrain(end, capsule.radius, terrain, a) for end in ends(capsule)]


def box_terrain(box: Box, terrain: Terrain, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Eight points: the corners, balls where edges are round."""
    return [ball_on_terrain(corner, box.edge, terrain, a) for corner in corners(box)]
