"""What the validation cases from textbooks share: final states with gradients, and exact motions of turning bodies."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from tools.laboratory import Lab, value_and_gradient

from symphys.types import Array

G = 9.81


def final(
    lab: Lab,
    start: Callable[[Any], Mapping[str, Any]],
    time: float,
    names: Sequence[str],
    at: Sequence[float],
    parameters: Callable[[Any], Any] | None = None,
) -> tuple[Array, Array]:
    """Quantities at the end of a rollout, and their gradient by what ``start`` and ``parameters`` depend on."""

    def end(z: Any) -> Any:
        p = parameters(z) if parameters else None
        last = lab.trajectory(start(z), time, p=p)[:, -1]
        return ca.vertcat(*(last[lab.layout[name]] for name in names))

    return value_and_gradient(end, at)


def differences(f: Callable[[Array], Any], at: Sequence[float], step: float = 1e-6) -> Array:
    """The gradient of a closed form, or of an exact motion, by central differences: one column a number of ``at``."""
    columns = []
    for i in range(len(at)):
        high, low = np.array(at, float), np.array(at, float)
        high[i] += step
        low[i] -= step
        columns.append((np.asarray(f(high)) - np.asarray(f(low))) / (2 * step))
    return np.stack(columns, axis=-1)


def turn(q: Array) -> Array:
    """(3, 3): the rotation matrix of a quaternion w x y z, of any length."""
    return np.asarray(Rotation.from_quat(q, scalar_first=True).as_matrix())


def spinning(q: Array, w: Array) -> Array:
    """(4,): the rate of a quaternion of a body that turns at w, world frame."""
    return np.array([-q[1:] @ w, *(q[0] * w + np.cross(w, q[1:]))]) / 2


def about_a_point(
    moments: Sequence[float], arm: Sequence[float], weight: float, q: Sequence[float], w: Sequence[float], time: float
) -> tuple[Array, Array]:
    """Orientation (4,) and angular velocity (3,), world frame, of a heavy body that turns about a fixed point.

    Euler: dL/dt = r x F. ``moments`` about the fixed point, ``arm`` from there to the centre of mass, body frame.
    """
    inertia = np.diag(moments)

    def rate(_: float, y: Array) -> Array:
        r = turn(y[:4])
        velocity = r @ np.linalg.solve(inertia, r.T @ y[4:])
        return np.concatenate([spinning(y[:4], velocity), np.cross(r @ arm, [0, 0, -weight])])

    r = turn(np.asarray(q, float))
    y0 = np.concatenate([q, r @ inertia @ r.T @ w])
    y = solve_ivp(rate, (0, time), y0, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    r = turn(y[:4])
    return y[:4] / np.linalg.norm(y[:4]), r @ np.linalg.solve(inertia, r.T @ y[4:])
