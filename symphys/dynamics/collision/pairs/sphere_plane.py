"""A sphere on a body against a static plane."""

from __future__ import annotations

from symphys.dynamics.collision.contact_geometry import Contact
from symphys.dynamics.collision.half_space import ball_on_plane
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.model.shapes import Plane, Sphere


def sphere_plane(sphere: Sphere, plane: Plane, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """One point."""
    return [ball_on_plane(a, sphere.centre, sphere.radius, plane)]
