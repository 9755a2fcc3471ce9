"""A compiled model at its reference pose: what other modules read off MuJoCo's arrays, and names for its parts.

World frame and SI units; quaternions are w x y z. Coordinates of joints are 0 at the reference pose (MuJoCo's qpos0).
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable, Mapping
from dataclasses import field
from typing import Any

import numpy as np

from symphys.importing.records import Finding, ImportOptions, JointMotor, Kind
from symphys.records import dataclass
from symphys.types import Array

MAX_NAME_LENGTH = 64
"""Largest number of characters of a name."""
WORDS = (
    "sin cos tan asin acos atan atan2 sinh cosh tanh sqrt exp log abs sign min max clip hypot norm sumsqr sum mean dot "
    "cross rotate world ground gravity time pi alive"
)
RESERVED_WORDS = (*keyword.kwlist, *WORDS.split())
"""Words that mean something in formulas or tables."""
FREE, BALL, SLIDE, HINGE = range(4)
"""MuJoCo's types of joints."""
DIGITS = 15
"""Significant digits of numbers in tables."""
ROUNDING = 1e-14
"""[m], [rad] Smaller numbers count as 0."""


class Names:
    """Names for all parts, each used once.

    Bodies, joints, surfaces, sites and sensors share one set of names in a problem file, but not in a model. A name
    that is taken gets the kind of the part behind it: ``knee_joint``.
    """

    def __init__(self) -> None:
        """Start with the words that have a meaning taken."""
        self._taken = {word.casefold() for word in RESERVED_WORDS}
        self.renamed: list[tuple[str, str]] = []

    def give(self, kind: str, wanted: str, fallback: str = "") -> str:
        """Return a new name like the wanted one; ``fallback`` for a part without a name."""
        base = re.sub(r"\W+", "_", wanted, flags=re.ASCII).strip("_")[: MAX_NAME_LENGTH - 8] or fallback or kind
        base = base if base[0].isascii() and base[0].isalpha() else f"{kind}_{base}"[: MAX_NAME_LENGTH - 8]
        found = next(name for name in self._offers(kind, base) if name.casefold() not in self._taken)
        self._taken.add(found.casefold())
        if wanted and found != wanted and kind != "group":
            self.renamed.append((f"{kind} {wanted}", found))
        return found

    def _offers(self, kind: str, base: str) -> Iterable[str]:
        yield base
        last = base.rpartition("_")[2]
        yield from (f"{base}_{kind}",) if last != kind else ()
        number = 2
        while True:
            yield f"{base}_{number}"
            number += 1


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
        """Return a point of the world in the body's frame, from the centre of mass."""
        return np.asarray(self.axes.T @ (point - self.centre))

    def turned(self, axes: Array) -> list[float]:
        """Return axes (3, 3) of the world as a quaternion in the body's frame."""
        return quaternion(self.axes.T @ axes)


@dataclass
class ModelReading:
    """A model that is being read.

    Attributes:
        library: the module ``mujoco``.
        model, data: MjModel, and MjData at the reference pose.
        options: of the caller.
        names: of all parts.
        findings: the fate of each part, in order.
        links: by the index of each body, the link that it belongs to; bodies that the world holds have none.
        joint_names: of joints, by index; of a free joint that of its body.
        rigid: number of equality constraints that were taken over.
        static_names: of what stands still, by the index of its geom.
        key: the index of the keyframe that the robot begins at; None: the reference pose.
        motors: the efforts and velocities that a URDF gives its joints, by their names there.
        seen: the names of bodies that have shapes only for the eye.
        driven: the names of joints with motors.
        jointed: two bodies that a joint holds together, in alphabetical order.
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
    seen: set[str] = field(default_factory=set)
    driven: set[str] = field(default_factory=set)
    jointed: set[tuple[str, ...]] = field(default_factory=set)

    def note(self, kind: Kind, what: str, how: str, amount: str = "") -> None:
        """Keep a finding on a part."""
        self.findings.append(Finding(kind, what, how, amount))

    def name(self, kind: str, index: int) -> str:
        """Return the model's name of a part, such as ``body`` 3; empty if it has none."""
        kind_of_object = getattr(self.library.mjtObj, f"mjOBJ_{kind.upper()}")
        return self.library.mj_id2name(self.model, kind_of_object, index) or ""

    def called(self, kind: str, index: int) -> str:
        """Return ``joint knee``, or ``joint 3`` if the part has no name."""
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
        """Return the indices of the joints of a body."""
        first = int(self.model.body_jntadr[body])
        return range(first, first + int(self.model.body_jntnum[body])) if first >= 0 else range(0)

    def reference(self, joint: int) -> float:
        """Return MuJoCo's coordinate of a hinge or slide at the reference pose."""
        return float(self.model.qpos0[self.model.jnt_qposadr[joint]])


def numbers(values: Any, scale: float = 1.0) -> Any:
    """Convert arrays to lists, and numbers to ``DIGITS`` digits; rounding errors against ``scale`` become 0."""
    if isinstance(values, np.ndarray | list | tuple):
        return [numbers(value, scale) for value in values]
    value = float(f"{float(values):.{DIGITS}g}")
    return 0.0 if abs(value) < ROUNDING * scale else value


def quaternion(axes: Array) -> list[float]:
    """Return a rotation matrix as a unit quaternion w x y z, w >= 0."""
    import mujoco

    q = np.empty(4)
    mujoco.mju_mat2Quat(q, np.ascontiguousarray(axes, float).ravel())
    found: list[float] = numbers(q if q[0] >= 0 else -q)
    return found


def matrix(quaternion: Any) -> Array:
    """Return the rotation matrix (3, 3) of a unit quaternion w x y z."""
    import mujoco

    found = np.empty(9)
    mujoco.mju_quat2Mat(found, np.asarray(quaternion, float))
    return found.reshape(3, 3)


def is_upright(orientation: list[float]) -> bool:
    """Whether a quaternion turns by no more than rounding."""
    return bool(np.abs(np.array(orientation[1:])).max() < 1e-14)
