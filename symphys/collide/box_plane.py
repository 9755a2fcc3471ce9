"""A box on a body against a static plane."""

from __future__ import annotations

from symphys.collide.contact import Contact
from symphys.collide.placing import corners
from symphys.collide.plane import ball_on_plane
from symphys.course import Course
from symphys.shapes import Box, Plane


def box_plane(box: Box, plane: Plane, a: Course, _: Course) -> list[Contact]:
    """Eight points: the corners."""
    return [ball_on_plane(a, corner, 0.0, plane) for corner in corners(box)]
