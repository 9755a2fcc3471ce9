"""Regularised primitives: each one's width is an argument, and width 0 is the exact function.

All have finite values and finite first and second derivatives everywhere, for every width >= 0.
"""

from __future__ import annotations

import casadi as ca

from symphys.types import Expr

TINY_SQUARE = 1e-24
"""Added under square roots of lengths: keeps the slope finite at zero length; 1e-12 in the length's own unit."""
TINY_WIDTH_SQUARE = 1e-120
"""Added under the square root of ``positive``, so that its second derivative exists at x = w = 0."""

TINY_RAMP = 1e-18
"""Added to the width of ``ramp``, so that its slope is finite."""


def positive(x: Expr, width: Expr) -> Expr:
    """Return max(x, 0), or for width w > 0 (x + sqrt(x^2 + w^2)) / 2, which exceeds it by at most w / 2, at x = 0.

    The fixed point of y = positive(y - c, w) is y c = w^2 / 4: the central path of y >= 0, c >= 0, y c = 0.
    """
    return ca.if_else(width > 0, _soft(x, width), ca.fmax(x, 0))


def positive_slope(x: Expr, width: Expr) -> Expr:
    """Return the slope of ``positive``; 0 at x = 0 for width 0."""
    smooth = (1 + x / ca.sqrt(x * x + width * width + TINY_WIDTH_SQUARE)) / 2
    return ca.if_else(width > 0, smooth, x > 0)


def ramp(x: Expr, width: Expr) -> Expr:
    """Rise linearly from 0 to 1 as x goes from -``width`` to ``width``; a step for width 0."""
    return ca.fmin(ca.fmax((1 + x / (width + TINY_RAMP)) / 2, 0), 1)


def at_least(x: Expr, low: Expr, width: Expr) -> Expr:
    """Return max(x, low), or low + positive(x - low, w) for width w > 0."""
    return ca.if_else(width > 0, low + _soft(x - low, width), ca.fmax(x, low))


def at_most(x: Expr, high: Expr, width: Expr) -> Expr:
    """Return min(x, high), or high - positive(high - x, w) for width w > 0."""
    return ca.if_else(width > 0, high - _soft(high - x, width), ca.fmin(x, high))


def _soft(x: Expr, width: Expr) -> Expr:
    return (x + ca.sqrt(x * x + width * width + TINY_WIDTH_SQUARE)) / 2


def clip(x: Expr, low: Expr, high: Expr, width: Expr) -> Expr:
    """Limit ``x`` to [low, high], exceeded by at most ``width`` / 2 at either end when smooth."""
    return low + positive(x - low, width) - positive(x - high, width)


def either(a: Expr, b: Expr) -> Expr:
    """Return the logical or of two flags, 0 or 1; a constant 0 leaves the other flag unchanged."""
    return a + b - a * b


def length(a: Expr) -> Expr:
    """Return |a| of a vector, with slope 0 at a = 0 (width 1e-12)."""
    return ca.sqrt(ca.dot(a, a) + TINY_SQUARE)


def angle_of(sine: Expr, cosine: Expr) -> Expr:
    """Return atan2(sine, cosine) [rad], with finite slopes where both are 0: the cosine is 1e-12 there."""
    nowhere = sine * sine + cosine * cosine < TINY_SQUARE
    return ca.atan2(sine, ca.if_else(nowhere, TINY_SQUARE**0.5, cosine))


def onto_disc(y: Expr, radius: Expr, width: Expr, smoothing: Expr) -> Expr:
    """Project ``y`` onto the disc |y| <= radius; with smoothing > 0 it is pulled inside over ``width``.

    Exact: y radius / |y| outside, y inside. Smooth: y radius / (radius + positive(|y| - radius, width)).
    """
    norm = length(y)
    smooth, outside = smoothing > 0, ca.dot(y, y) >= radius * radius
    reach = ca.if_else(smooth, radius + positive(norm - radius, width) + 1e-30, norm)
    return y * ca.if_else(ca.logic_or(smooth, outside), radius / reach, 1)
