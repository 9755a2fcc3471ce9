"""A sphere on a body against a static plane."""

from __future__ import annotations

from symphys.collide.contact import Contact
from symphys.collide.plane import ball_on_plane
from symphys.course import Course
from symphys.shapes import Plane, Sphere


def sphere_plane(sphere: Sphere, plane: Plane, a: Course, _: Course) -> list[Contact]:
    """One point."""
    return [ball_on_plane(a, sphere.centre, sphere.radius, plane)]
