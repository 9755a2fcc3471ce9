"""Trees of joints at one instant: accelerations under known forces, and velocities that fit the joints.

Forces of joints need not be known: they do nothing along the free motions of the instant, J^T f = 0, so
J^T (M (J q'' + bias) + w x I w - forces) = 0 gives the accelerations of the coordinates, and J^T (M J q' - momenta) = 0
the velocities that momenta stand for.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from symphys import rotation
from symphys.course import Course
from symphys.joints import Joint, Linkage
from symphys.motion import Motion, inertia_matrix
from symphys.step.chart import Columns, columns_of, dense, mass_matrix
from symphys.step.elimination import Eliminated
from symphys.step.momentum import Momentum

Expr = Any
"""casadi SX"""
Wrench = tuple[Expr, Expr]
"""Force [N] and torque [N m] about the centre of mass; also linear and angular acceleration."""


def accelerations(
    linkage: Linkage, joints: Sequence[Joint | None], motions: Sequence[Motion], wrenches: Sequence[Wrench]
) -> tuple[Wrench, ...]:
    """Of the bodies of a tree, from their poses and velocities and all forces but the joints'."""
    t = ca.SX.sym("t")
    courses = [_turning(motion) for motion in motions]
    moving = columns_of(linkage, joints, courses, t, common=False)
    still = [{k: tuple(_at_start(part, t) for part in column) for k, column in columns.items()} for columns in moving]
    masses, inertias = [m.mass for m in motions], [_inertia(m.inertia, m.rotation) for m in motions]
    matrix = Eliminated(mass_matrix(linkage, still, still, masses, inertias))
    rates = matrix.solve(_projected(still, [_momentum(m, i) for m, i in zip(motions, inertias, strict=True)], masses))
    biases = [_rate_of_change(columns, rates, t) for columns in moving]
    right: dict[int, Expr] = {}
    for columns, motion, inertia, bias, (force, torque) in zip(still, motions, inertias, biases, wrenches, strict=True):
        w = motion.angular_velocity
        push = force - motion.mass * bias[0]
        twist = torque - ca.mtimes(inertia, bias[1]) - ca.cross(w, ca.mtimes(inertia, w))
        for k, (velocity, spin) in columns.items():
            right[k] = right.get(k, 0) + ca.dot(velocity, push) + ca.dot(spin, twist)
    speeding = matrix.solve(right)
    return tuple(
        (linear + bias[0], angular + bias[1])
        for (linear, angular), bias in zip((_moved(c, speeding) for c in still), biases, strict=True)
    )


def consistent(
    linkage: Linkage,
    joints: Sequence[Joint | None],
    inertials: Sequence[tuple[Expr, Expr]],
    poses: Sequence[tuple[Expr, Expr]],
    momenta: Sequence[Momentum],
) -> tuple[tuple[Expr, Expr], ...]:
    """Velocity and angular velocity of each body: those that fit the joints and have the momenta along free motions."""
    zero = ca.SX.zeros(3)
    turned = [rotation.matrix(q) for _, q in poses]
    courses = [Course(p, r, zero, zero, zero, zero, ca.SX(0)) for (p, _), r in zip(poses, turned, strict=True)]
    columns = columns_of(linkage, joints, courses, ca.SX(0), common=True)
    masses = [mass for mass, _ in inertials]
    tensors = [_inertia(inertia, r) for (_, inertia), r in zip(inertials, turned, strict=True)]
    matrix = Eliminated(mass_matrix(linkage, columns, columns, masses, tensors))
    rates = matrix.solve(_projected(columns, momenta, masses))
    return tuple(_moved(each, rates) for each in columns)


def _turning(motion: Motion) -> Course:
    """The body's course without its accelerations."""
    zero = ca.SX.zeros(3)
    return Course(motion.position, motion.rotation, motion.velocity, zero, motion.angular_velocity, zero, motion.dt)


def _at_start(expression: Expr, t: Expr) -> Expr:
    return ca.substitute(expression, t, ca.SX(0))


def _rate_of_change(columns: Columns, rates: dict[int, Expr], t: Expr) -> Wrench:
    """Of a body's velocities, at rates that do not change."""
    velocity, spin = _moved(columns, rates)
    both = ca.vertcat(velocity, spin)
    change = _at_start(ca.jtimes(both, t, ca.SX(1)), t)
    return change[:3], change[3:]


def _moved(columns: Columns, rates: dict[int, Expr]) -> Wrench:
    velocity, spin = ca.SX.zeros(3), ca.SX.zeros(3)
    for k, (along, about) in columns.items():
        velocity, spin = velocity + along * rates.get(k, 0), spin + about * rates.get(k, 0)
    return velocity, spin


def _inertia(inertia: Expr, turned: Expr) -> Expr:
    """(3, 3), world frame."""
    return ca.mtimes(turned, ca.mtimes(inertia_matrix(inertia), turned.T))


def _momentum(motion: Motion, inertia: Expr) -> Momentum:
    return Momentum(motion.velocity, ca.mtimes(inertia, motion.angular_velocity))


def _projected(columns: Sequence[Columns], momenta: Sequence[Momentum], masses: Sequence[Expr]) -> dict[int, Expr]:
    right: dict[int, Expr] = {}
    for each, momentum, mass in zip(columns, momenta, masses, strict=True):
        for k, (velocity, spin) in each.items():
            right[k] = right.get(k, 0) + mass * ca.dot(velocity, momentum.velocity) + ca.dot(spin, momentum.angular)
    return right


__all__ = ["accelerations", "consistent", "dense"]
