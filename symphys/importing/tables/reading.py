"""A compiled model at its reference pose: what other modules read off MuJoCo's arrays.

World frame and SI units; quaternions are w x y z. Coordinates of joints are 0 at the reference pose (MuJoCo's qpos0).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from symphys.importing.findings import Finding, Kind
from symphys.importing.options import ImportOptions
from symphys.importing.source import JointMotor
from symphys.importing.tables.names import Names
from symphys.types import Array

FREE, BALL, SLIDE, HINGE = range(4)
"""MuJoCo's types of joints."""
DIGITS = 15
"""Significant digits of numbers in tables."""
ROUNDING = 1e-14
"""[m], [rad]: what is smaller is 0."""


@dataclass(frozen=True)
class WeldedLink:
    """Bodies of a model that are welded to each other, as one body of a world.

    Attributes:
        top: the index of the body that joints hold.
        members: the indices of all.
        name: in tables.
        mass: [kg].
        centre: (3,) of mass, world frame [m].
        axes: (3, 3) columns are the axes of the body's frame, those of the top body.
        inertia: (3, 3) about the centre of mass, body frame [kg m^2].
    """

    top: int
    members: tuple[int, ...]
    name: str
    mass: float
    centre: Array
    axes: Array
    inertia: Array

    def to_body(self, point: Array) -> Array:
        """A point of the world in the body's frame, from the centre of mass."""
        return np.asarray(self.axes.T @ (point - self.centre))

    def turned(self, axes: Array) -> list[float]:
        """Axes (3, 3) of the world as a quaternion in the body's frame."""
        return quaternion(self.axes.T @ axes)


@dataclass
class ModelReading:
    """A model that is being read.

    Attributes:
        library: the module ``mujoco``.
        model, data: MjModel, and MjData at the reference pose.
        options: what the caller chose.
        names: that are given.
        findings: what became of parts, in order.
        links: by the index of each body, the link that it belongs to; bodies that the world holds have none.
        joint_names: of joints, by index; of a free joint that of its body.
        rigid: number of equality constraints that were taken over.
        static_names: of what stands still, by the index of its geom.
        site_names: of sites, by index.
        key: the index of the keyframe that the robot begins at; None: the reference pose.
        motors: the efforts and velocities that a URDF gives its joints, by their names there.
        seen: the names of bodies that have shapes only for the eye.
        driven: the names of joints with motors.
        jointed: two bodies that a joint holds together, in alphabetical order.
        apart: two bodies that several joints hold together, which do not touch each other.
    """

    library: Any
    model: Any
    data: Any
    options: ImportOptions
    key: int | None = None
    motors: Mapping[str, JointMotor] = field(default_factory=dict)
    names: Names = field(default_factory=Names)
    findings: list[Finding] = field(default_factory=list)
    links: dict[int, WeldedLink] = field(default_factory=dict)
    joint_names: dict[int, str] = field(default_factory=dict)
    rigid: int = 0
    static_names: dict[int, str] = field(default_factory=dict)
    site_names: dict[int, str] = field(default_factory=dict)
    seen: set[str] = field(default_factory=set)
    driven: set[str] = field(default_factory=set)
    jointed: set[tuple[str, ...]] = field(default_factory=set)
    apart: list[tuple[str, str]] = field(default_factory=list)

    def note(self, kind: Kind, what: str, how: str, amount: str = "") -> None:
        """Keep what became of a part."""
        self.findings.append(Finding(kind, what, how, amount))

    def name(self, kind: str, index: int) -> str:
        """What the model calls a part, ``body`` 3 for instance; empty if it has no name."""
        types = self.library.mjtObj
        kinds: Mapping[str, Any] = {
            "body": types.mjOBJ_BODY,
            "joint": types.mjOBJ_JOINT,
            "geom": types.mjOBJ_GEOM,
            "site": types.mjOBJ_SITE,
            "actuator": types.mjOBJ_ACTUATOR,
            "sensor": types.mjOBJ_SENSOR,
            "equality": types.mjOBJ_EQUALITY,
            "tendon": types.mjOBJ_TENDON,
            "key": types.mjOBJ_KEY,
            "mesh": types.mjOBJ_MESH,
        }
        return self.library.mj_id2name(self.model, kinds[kind], index) or ""

    def called(self, kind: str, index: int) -> str:
        """``joint knee``, or ``joint 3`` where it has no name."""
        return f"{kind} {self.name(kind, index) or index}"

    def off(self, flag: str) -> bool:
        """Whether the model's options switch something off: "CONTACT", "LIMIT", "SPRING", ..."""
        flags = int(self.model.opt.disableflags)
        rigid = flag in ("CONTACT", "LIMIT", "EQUALITY", "FRICTIONLOSS")
        own = bool(flags & int(getattr(self.library.mjtDisableBit, f"mjDSBL_{flag}")))
        return own or (rigid and bool(flags & int(self.library.mjtDisableBit.mjDSBL_CONSTRAINT)))

    def holds(self, equality: int) -> bool:
        """Whether an equality constraint is active."""
        return bool(self.model.eq_active0[equality]) and not self.off("EQUALITY")

    def joints_of(self, body: int) -> range:
        """The indices of the joints of a body."""
        first = int(self.model.body_jntadr[body])
        return range(first, first + int(self.model.body_jntnum[body])) if first >= 0 else range(0)

    def reference(self, joint: int) -> float:
        """MuJoCo's coordinate of a hinge or slide at the reference pose."""
        return float(self.model.qpos0[self.model.jnt_qposadr[joint]])


def numbers(values: Any, scale: float = 1.0) -> Any:
    """Arrays as lists, and numbers with ``DIGITS`` digits; what is rounding against ``scale`` is 0."""
    if isinstance(values, np.ndarray | list | tuple):
        return [numbers(value, scale) for value in values]
    value = float(f"{float(values):.{DIGITS}g}")
    return 0.0 if abs(value) < ROUNDING * scale else value


def quaternion(axes: Array) -> list[float]:
    """A rotation matrix as a unit quaternion w x y z, w >= 0."""
    trace = np.trace(axes)
    four = np.array([1 + trace, *(1 + 2 * axes[k, k] - trace for k in range(3))])
    largest = int(np.argmax(four))
    skew = np.array([axes[2, 1] - axes[1, 2], axes[0, 2] - axes[2, 0], axes[1, 0] - axes[0, 1]])
    q = np.empty(4)
    if largest == 0:
        q[0], q[1:] = four[0], skew
    else:
        k = largest - 1
        q[0], q[1:] = skew[k], axes[k] + axes[:, k]
        q[largest] = four[largest]
    q /= np.linalg.norm(q)
    q = q if q[0] >= 0 else -q
    found: list[float] = numbers(q)
    return found


def is_upright(orientation: list[float]) -> bool:
    """Whether a quaternion turns by rounding only."""
    return bool(np.abs(np.array(orientation[1:])).max() < 1e-14)
