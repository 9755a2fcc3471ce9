"""Trees of joints at one instant: accelerations under known forces, and velocities that fit the joints.

Forces of joints need not be known: they do nothing along the free motions of the instant, so that along these the rates
of change of momenta equal the other forces, and momenta those that velocities stand for.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys import rotation
from symphys.course import Course
from symphys.joints import Joint, Link, Linkage
from symphys.motion import Motion, inertia_matrix
from symphys.step import screws
from symphys.step.elimination import Eliminated
from symphys.step.momentum import Momentum

Expr = Any
"""casadi SX"""
Wrench = tuple[Expr, Expr]
"""Force [N] and torque [N m] about the centre of mass; also linear and angular acceleration."""


def accelerations(
    linkage: Linkage, joints: screws.Joints, motions: Sequence[Motion], wrenches: Sequence[Wrench]
) -> tuple[Wrench, ...]:
    """Of the bodies of a tree, from their poses and velocities and all forces but the joints'."""
    origin, now = motions[0].position, ca.SX(0)
    along = screws.screws(linkage, joints, motions, now, origin)
    places = [m.position - origin for m in motions]
    tensors = [world_inertia(m.inertia, m.rotation) for m in motions]
    matrix = _matrix(linkage, [m.mass for m in motions], tensors, places, along)
    momenta = [
        screws.about_origin(place, m.mass * m.velocity, ca.mtimes(tensor, m.angular_velocity))
        for place, m, tensor in zip(places, motions, tensors, strict=True)
    ]
    rates = matrix.solve(screws.along_screws(linkage, along, momenta))
    biases = _biases(linkage, joints, along, rates)
    moving = screws.summed_down(linkage, along, rates)
    lacking = []
    for m, place, tensor, screw, bias, (force, torque) in zip(
        motions, places, tensors, moving, biases, wrenches, strict=True
    ):
        linear, angular = _at(bias, screw, place)
        w = screw[:3]
        turning = ca.mtimes(tensor, angular) + ca.cross(w, ca.mtimes(tensor, w))
        lacking.append(screws.about_origin(place, force - m.mass * linear, torque - turning))
    speeding = matrix.solve(screws.along_screws(linkage, along, lacking))
    changes = screws.summed_down(linkage, along, speeding)
    return tuple(
        _at(change + bias, screw, place)
        for change, bias, screw, place in zip(changes, biases, moving, places, strict=True)
    )


def consistent(
    linkage: Linkage,
    joints: screws.Joints,
    inertials: Sequence[tuple[Expr, Expr]],
    poses: Sequence[tuple[Expr, Expr]],
    momenta: Sequence[Momentum],
) -> tuple[Wrench, ...]:
    """Velocity and angular velocity of each body: those that fit the joints and have the momenta along free motions."""
    zero, origin = ca.SX.zeros(3), poses[0][0]
    turned = [rotation.matrix(q) for _, q in poses]
    courses = [Course(p, r, zero, zero, zero, zero, ca.SX(0)) for (p, _), r in zip(poses, turned, strict=True)]
    along = screws.screws(linkage, joints, courses, ca.SX(0), origin)
    places = [p - origin for p, _ in poses]
    masses = [mass for mass, _ in inertials]
    tensors = [world_inertia(inertia, r) for (_, inertia), r in zip(inertials, turned, strict=True)]
    matrix = _matrix(linkage, masses, tensors, places, along)
    counted = [
        screws.about_origin(place, mass * momentum.velocity, momentum.angular)
        for place, mass, momentum in zip(places, masses, momenta, strict=True)
    ]
    rates = matrix.solve(screws.along_screws(linkage, along, counted))
    moving = screws.summed_down(linkage, along, rates)
    return tuple(screws.at_place(screw, place) for screw, place in zip(moving, places, strict=True))


def _matrix(
    linkage: Linkage, masses: Sequence[Expr], tensors: Sequence[Expr], places: Sequence[Expr], along: list[Expr]
) -> Eliminated:
    parts = zip(masses, tensors, places, strict=True)
    inertias = [screws.inertia_of(mass, tensor, place, place) for mass, tensor, place in parts]
    return Eliminated(screws.mass_matrix(linkage, inertias, along, along))


def _biases(linkage: Linkage, joints: screws.Joints, along: Sequence[Expr], rates: dict[int, Expr]) -> list[Expr]:
    """(6,) rates of change of the bodies' screws while the coordinates' rates do not change."""
    moving = screws.summed_down(linkage, along, rates)
    found: list[Expr] = []
    for k, (link, parent, joint) in enumerate(zip(linkage.links, screws.parents(linkage), joints, strict=True)):
        total = ca.SX.zeros(6) if parent is None else found[parent]
        if joint is None:
            velocity, spin = moving[k][3:], moving[k][:3]  # the root's centre of mass is at the origin
            found.append(total + ca.vertcat(ca.SX.zeros(3), ca.cross(velocity, spin)))
            continue
        for place, j in enumerate(screws.own(link)):
            carrier = _carrier(link, joint, place, k, parent)
            if carrier is not None:
                total = total + rates.get(j, 0) * _carried(moving[carrier], along[j])
        found.append(total)
    return found


def _carrier(link: Link, joint: Joint, place: int, child: int, parent: int | None) -> int | None:
    """The link on whose body the axis of a coordinate is fixed; None: the world."""
    first = bool(joint.kind.coordinates) and joint.kind.coordinates[place].fixed_in_first
    return child if first == (link.sign > 0) else parent


def _carried(moving: Expr, screw: Expr) -> Expr:
    """(6,): how a screw that is fixed in a body changes as the body moves."""
    w, v = moving[:3], moving[3:]
    return ca.vertcat(ca.cross(w, screw[:3]), ca.cross(w, screw[3:]) + ca.cross(v, screw[:3]))


def _at(change: Expr, screw: Expr, place: Expr) -> Wrench:
    """Acceleration of the centre of mass, at ``place``, and angular acceleration: from a screw and its change."""
    velocity = screws.at_place(screw, place)[0]
    return change[3:] + ca.cross(change[:3], place) + ca.cross(screw[:3], velocity), change[:3]


def world_inertia(inertia: Expr, turned: Expr) -> Expr:
    """(3, 3), world frame."""
    return ca.mtimes(turned, ca.mtimes(inertia_matrix(inertia), turned.T))
