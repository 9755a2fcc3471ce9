"""A capsule on one body against a box on another, or a static one.

The round ends touch the box anywhere, the side between them touches corners of the box, and its edges where they cross
the capsule.
"""

from __future__ import annotations

import casadi as ca

from symphys.collide.block import Block, block, facing, farthest, meeting_time, separations
from symphys.collide.box_box import Approach, edges_across
from symphys.collide.contact import Contact, flipped
from symphys.collide.field import ball_in_field
from symphys.collide.placing import axes, ends
from symphys.collide.sphere_box import BoxField
from symphys.collide.sphere_capsule import CapsuleField
from symphys.course import Course
from symphys.shapes import Box, Capsule


def capsule_box(capsule: Capsule, box: Box, a: Course, b: Course) -> list[Contact]:
    """Eight points: the round ends, the side across the box's face, the corners of that face."""
    field, tips = BoxField(box.half_sizes), ends(capsule)
    found = [ball_in_field(a.path(end), a.arm(end), capsule.radius, box, field, b) for end in tips]
    rod, other = Block(a.path(capsule.centre), axes(a, capsule), (0.0, 0.0, capsule.half_length)), block(box, b)
    directions = [*rod.axes, *other.axes, *(rod.axes[2].cross(edge) for edge in other.axes)]
    distances = [separations(rod, other, directions, t, since=0)[3:] for t in (ca.SX(0), a.dt)]
    shrunk = [[distance - capsule.radius for distance in some] for some in distances]
    time = meeting_time(shrunk[0], shrunk[1], a.dt)
    chosen, distance = farthest(directions[3:], separations(rod, other, directions, time)[3:])
    apart = (rod.centre - other.centre).at(time)
    normal = ca.if_else(ca.dot(apart, chosen.at(time)) >= 0, 1, -1) * chosen
    far = ca.fmax(distance, 0) + capsule.half_length + sum(box.half_sizes)
    approach = Approach((a, b), normal, time, far)
    ground = facing(other, normal.at(time), time)
    found += edges_across([a.path(end) for end in tips], ground, approach, capsule.radius)
    side = CapsuleField(capsule.radius, capsule.half_length)
    corners = [ball_in_field(c, c - b.centre(), 0.0, capsule, side, a) for c in ground.corners()]
    return found + [flipped(contact) for contact in corners]
