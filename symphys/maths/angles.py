"""Angles modulo whole turns."""

from __future__ import annotations

import casadi as ca

from symphys.types import Expr


def nearest(angle: Expr, to: Expr) -> Expr:
    """Return the angle [rad] nearest to ``to`` that differs from ``angle`` by whole turns.

    Its derivative is that of ``angle``: ``to`` only chooses.
    """
    return angle + 2 * ca.pi * ca.floor((to - angle) / (2 * ca.pi) + 0.5)


def wrap_to_pi(angle: Expr) -> Expr:
    """Wrap an angle [rad] to the interval from -pi to pi."""
    return nearest(angle, 0.0)
