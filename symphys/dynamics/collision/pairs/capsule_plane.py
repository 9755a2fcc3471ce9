"""A capsule on a body against a static plane: the capsule's lowest points are on its round ends."""

from __future__ import annotations

from symphys.dynamics.collision.body_points import ends
from symphys.dynamics.collision.contact_geometry import Contact
from symphys.dynamics.collision.half_space import ball_on_plane
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.model.shapes import Capsule, Plane


def capsule_plane(capsule: Capsule, plane: Plane, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Two points: the round ends."""
    return [ball_on_plane(a, end, capsule.radius, plane) for end in ends(capsule)]
