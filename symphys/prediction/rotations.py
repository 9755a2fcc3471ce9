"""Rotation vectors between unit quaternions (w, x, y, z), with their derivatives."""

from __future__ import annotations

import numpy as np

from symphys.types import Array

SMALL_ANGLE = 1e-4
"""Sine of half an angle below which series replace quotients."""


def turned(q: Array, v: Array) -> tuple[Array, Array]:
    """Return q exp(v / 2) (4,) for a rotation vector v (3,) [rad] in the frame of q, and its derivative (4, 3)."""
    half = float(np.linalg.norm(v)) / 2
    sinc = np.sinc(half / np.pi)
    turn = np.array([np.cos(half), *(sinc / 2 * v)])
    slope = (np.cos(half) - sinc) / half**2 / 8 if half > SMALL_ANGLE else -1 / 24
    by = np.vstack([-sinc / 4 * v, sinc / 2 * np.eye(3) + slope * np.outer(v, v)])
    w, x, y, z = q
    left = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    return left @ turn, left @ by


def rotation_vectors(q: Array, p: Array) -> Array:
    """Return (n, 3) [rad] the rotation vectors of conj(q) p, from q to p (n, 4), in the frame of q; at most pi long."""
    w, v, _ = _relative(q, p)
    return np.asarray(_factors(w, v)[0] * v)


def rotation_slopes(q: Array, p: Array) -> Array:
    """Return (n, 3, 4) the derivatives of ``rotation_vectors`` by p."""
    w, v, rows = _relative(q, p)
    factor, by_w, by_s = _factors(w, v)
    by_v = factor[:, :, None] * np.eye(3) + by_s[:, :, None] * v[:, :, None] * v[:, None, :]
    return np.asarray(by_v @ rows[:, 1:] + by_w[:, :, None] * v[:, :, None] * rows[:, :1])


def _relative(q: Array, p: Array) -> tuple[Array, Array, Array]:
    """Return scalar part (n, 1) >= 0 and vector part (n, 3) of conj(q) p, and their derivatives by p (n, 4, 4)."""
    w, x, y, z = q.T
    rows = np.array([[w, x, y, z], [-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]]).transpose(2, 0, 1)
    found = np.einsum("nij,nj->ni", rows, p)
    sign = np.where(found[:, :1] < 0, -1.0, 1.0)
    found, rows = sign * found, sign[:, :, None] * rows
    return found[:, :1], found[:, 1:], rows


def _factors(w: Array, v: Array) -> tuple[Array, Array, Array]:
    """Return f with rotation vector f v, its derivative by w, and that by |v| over |v|; each (n, 1)."""
    s = np.linalg.norm(v, axis=1, keepdims=True)
    size, small = w**2 + s**2, s < SMALL_ANGLE
    safe, whole = np.where(small, 1.0, s), np.where(small, w, 1.0)
    f = np.where(small, 2 / whole * (1 - s**2 / (3 * whole**2)), 2 * np.arctan2(safe, w) / safe)
    by_s = np.where(small, -4 / (3 * whole**3), (2 * w / size - f) / safe**2)
    return f, -2 / size, by_s
