"""Angles that differ by whole turns."""

from __future__ import annotations

import casadi as ca

from symphys.types import Expr


def nearest(angle: Expr, to: Expr) -> Expr:
    """Of all angles that differ from ``angle`` by whole turns the one that is nearest to ``to`` [rad].

    Its derivative is that of ``angle``: ``to`` only chooses.
    """
    return angle + 2 * ca.pi * ca.floor((to - angle) / (2 * ca.pi) + 0.5)


def wrap_to_pi(angle: Expr) -> Expr:
    """The angle between -pi and pi that differs from ``angle`` by whole turns [rad]."""
    return nearest(angle, 0.0)
