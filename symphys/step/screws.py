"""Trees of bodies in screws: pairs (w, v) of an angular velocity and the velocity of the body's point at an origin.

The origin is where the root's centre of mass is at the start of a stretch. Momenta about it are pairs (l, p) likewise,
(6,) columns both. A coordinate's screw is how all that hangs on it moves for a unit rate, one for the whole subtree.
Featherstone, Rigid Body Dynamics Algorithms (2008), chapters 2 and 6; deviation: where velocities are seen at one time
and momenta counted at another, inertias are not symmetric.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca

from symphys.course import Course
from symphys.joints import Joint, Link, Linkage, Placed
from symphys.rotation import cross_matrix
from symphys.step.sockets import Sockets, sockets_on

Expr = Any
"""casadi SX"""
Joints = Sequence[Joint | None]
"""The joint of each link; None for a root that floats."""


def parents(linkage: Linkage) -> list[int | None]:
    """For each link the place of its parent among the links."""
    place = {link.body: k for k, link in enumerate(linkage.links)}
    return [None if link.parent is None else place[link.parent] for link in linkage.links]


def paths(linkage: Linkage) -> list[list[int]]:
    """For each link the coordinates that move it, from the root on."""
    found: list[list[int]] = []
    for link, parent in zip(linkage.links, parents(linkage), strict=True):
        above = [] if parent is None else found[parent]
        found.append([*above, *range(link.start, link.start + link.count)])
    return found


def screws(linkage: Linkage, joints: Joints, courses: Sequence[Course], t: Expr, origin: Expr) -> list[Expr]:
    """(6,) for each coordinate, at time t."""
    found: list[Expr] = []
    for link, joint, parent, course in zip(linkage.links, joints, parents(linkage), courses, strict=True):
        if joint is None:
            found += floating(course.centre().at(t) - origin)
            continue
        above = () if parent is None else (courses[parent],)
        sockets = sockets_on(joint, (course, *above) if link.sign > 0 else (*above, course))
        point = joint_point(sockets, t) - origin
        for slide, turn in free_motions_of(joint, sockets.placed(t)):
            found.append(link.sign * ca.vertcat(turn, slide + ca.cross(point, turn)))
    return found


def floating(place: Expr) -> list[Expr]:
    """Of a root whose centre of mass is at ``place``: its velocity and angular velocity, along the world's axes."""
    unit, zero = ca.SX.eye(3), ca.SX.zeros(3)
    slides = [ca.vertcat(zero, unit[:, k]) for k in range(3)]
    return slides + [ca.vertcat(unit[:, k], ca.cross(place, unit[:, k])) for k in range(3)]


def joint_point(sockets: Sockets, t: Expr) -> Expr:
    """(3,): midway between both sockets; at the first one's for what slides."""
    first, second = (c + a for c, a in zip(sockets.centres, sockets.arms, strict=True))
    if sockets.joint.kind.slides is not None:
        return first.at(t)
    return (first.at(t) + second.at(t)) / 2


def free_motions_of(joint: Joint, placed: Placed) -> list[tuple[Expr, Expr]]:
    """(displacement, rotation) (3,) each of the first side against the second, that a joint leaves free."""
    zero = ca.SX.zeros(3)
    if joint.kind.coordinates:
        axes = [(c.turns, c.axis(placed)) for c in joint.kind.coordinates]
        return [(zero, axis) if turns else (axis, zero) for turns, axis in axes]
    return [(zero, placed.b[:, k]) for k in range(6 - joint.locked)]


def inertia_of(mass: Expr, inertia: Expr, counted: Expr, seen: Expr) -> Expr:
    """(6, 6): the momentum of a body about the origin for a screw, its centre of mass counted and seen at two places.

    ``inertia``: (3, 3) about the centre of mass, world frame.
    """
    here, there = cross_matrix(counted), cross_matrix(seen)
    upper = ca.horzcat(inertia - mass * ca.mtimes(here, there), mass * here)
    return ca.vertcat(upper, ca.horzcat(-mass * there, mass * ca.SX.eye(3)))


def summed_up(linkage: Linkage, parts: Sequence[Expr]) -> list[Expr]:
    """For each link the sum over all that hangs on it."""
    total = list(parts)
    for k, parent in reversed(list(enumerate(parents(linkage)))):
        if parent is not None:
            total[parent] = total[parent] + total[k]
    return total


def summed_down(linkage: Linkage, along: Sequence[Expr], amounts: Mapping[int, Expr]) -> list[Expr]:
    """(6,) for each link: the screw of its body, from the amounts of all coordinates that move it."""
    found: list[Expr] = []
    for link, parent in zip(linkage.links, parents(linkage), strict=True):
        total = ca.SX.zeros(6) if parent is None else found[parent]
        for k in range(link.start, link.start + link.count):
            total = total + amounts.get(k, 0) * along[k]
        found.append(total)
    return found


def mass_matrix(
    linkage: Linkage, inertias: Sequence[Expr], seen: Sequence[Expr], given: Sequence[Expr]
) -> list[dict[int, Expr]]:
    """By rows: momenta along the screws that are given, of rates along those that are seen."""
    rows: list[dict[int, Expr]] = [{} for _ in range(linkage.size)]
    for link, path, inertia in zip(linkage.links, paths(linkage), summed_up(linkage, inertias), strict=True):
        for k in own(link):
            momentum = ca.mtimes(inertia, seen[k])
            for i in path:
                rows[i][k] = ca.dot(given[i], momentum)
            above = path[: -link.count]
            push = ca.mtimes(inertia.T, given[k]) if given is not seen else momentum
            for i in above:
                rows[k][i] = rows[i][k] if given is seen else ca.dot(push, seen[i])
    return rows


def limbs(linkage: Linkage) -> list[list[int]]:
    """The coordinates of what hangs on the root, limb by limb."""
    above, limb_of, found = parents(linkage), dict[int, int](), list[list[int]]()
    for k, link in enumerate(linkage.links[1:], 1):
        parent = above[k]
        limb = limb_of.get(parent if parent is not None else 0)
        if limb is None:
            limb = len(found)
            found.append([])
        limb_of[k] = limb
        found[limb] += own(link)
    return [limb for limb in found if limb]


def own(link: Link) -> range:
    """The coordinates of a link."""
    return range(link.start, link.start + link.count)


def along_screws(linkage: Linkage, given: Sequence[Expr], momenta: Sequence[Expr]) -> dict[int, Expr]:
    """By coordinate: the momenta, or forces, (6,) of the links' bodies along its screw."""
    totals = summed_up(linkage, momenta)
    return {k: ca.dot(given[k], total) for link, total in zip(linkage.links, totals, strict=True) for k in own(link)}


def about_origin(place: Expr, linear: Expr, angular: Expr) -> Expr:
    """(6,): a momentum or force about the origin, from that about ``place``."""
    return ca.vertcat(angular + ca.cross(place, linear), linear)


def at_place(screw: Expr, place: Expr) -> tuple[Expr, Expr]:
    """Velocity of the body's point at ``place``, and angular velocity."""
    return screw[3:] + ca.cross(screw[:3], place), screw[:3]
