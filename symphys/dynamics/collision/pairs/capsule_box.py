"""A capsule on one body against a box on another, or a static one.

The round ends touch the box anywhere, the side between them touches corners of the box, and its edges where they cross
the capsule.
"""

from __future__ import annotations

from symphys.dynamics.collision.body_points import ends
from symphys.dynamics.collision.box_geometry import first_overlap, moving_box, nearest_face
from symphys.dynamics.collision.contact_geometry import Contact, flipped
from symphys.dynamics.collision.pairs.box_box import approach_of, edges_across
from symphys.dynamics.collision.pairs.sphere_box import ball_at_box
from symphys.dynamics.collision.pairs.sphere_capsule import ball_at_capsule
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.model.shapes import Box, Capsule


def capsule_box(capsule: Capsule, box: Box, a: PredictedPath, b: PredictedPath) -> list[Contact]:
    """Return eight points: the round ends, the side across the box's face, the corners of that face."""
    tips = ends(capsule)
    found = [ball_at_box(end, capsule.radius, box, a, b) for end in tips]
    rod, other = moving_box(capsule, a), moving_box(box, b)
    edges = [rod.axes[2].cross(edge) for edge in other.axes]
    near = first_overlap(rod, other, list(other.axes), edges, a.dt, capsule.radius)
    approach = approach_of(near, (a, b), capsule.half_length + sum(box.half_sizes))
    ground = nearest_face(other, near.direction.at(near.time), near.time)
    found += edges_across([a.path(end) for end in tips], ground, approach, capsule.radius)
    corners = [ball_at_capsule(c, c - b.centre(), 0.0, capsule, a) for c in ground.corners()]
    return found + [flipped(contact) for contact in corners]
