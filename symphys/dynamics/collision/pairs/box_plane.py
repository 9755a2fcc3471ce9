"""A box on a body against a static plane."""

from __future__ import annotations

from symphys.dynamics.collision.body_points import corners
from symphys.dynamics.collision.contact_geometry import Contact
from symphys.dynamics.collision.half_space import ball_on_plane
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.model.shapes import Box, Plane


def box_plane(box: Box, plane: Plane, a: PredictedPath, _: PredictedPath) -> list[Contact]:
    """Eight points: the corners, balls where edges are round."""
    return [ball_on_plane(a, corner, box.edge, plane) for corner in corners(box)]
