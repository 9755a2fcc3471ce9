"""A capsule on a body against a static plane: the capsule's lowest points are on its round ends."""

from __future__ import annotations

from symphys.collide.contact import Contact
from symphys.collide.placing import ends
from symphys.collide.plane import ball_on_plane
from symphys.course import Course
from symphys.shapes import Capsule, Plane


def capsule_plane(capsule: Capsule, plane: Plane, a: Course, _: Course) -> list[Contact]:
    """Two points: the round ends."""
    return [ball_on_plane(a, end, capsule.radius, plane) for end in ends(capsule)]
