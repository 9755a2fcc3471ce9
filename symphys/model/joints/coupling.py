"""Couplings: a coordinate that follows another, as a gear or a parallel gripper makes it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from symphys.model.joints.joint import Joint
from symphys.model.scalar import Scalar
from symphys.records import dataclass

DEGREE = 4
"""Of the polynomial."""


@dataclass(frozen=True)
class JointCoupling:
    """The coordinate of one joint is a polynomial of that of another (MuJoCo's equality constraint of joints).

    Attributes:
        name: how the state refers to it.
        first: the index of the joint that follows.
        second: the index of the joint that it follows; None: the first is held at the polynomial's constant.
        polynomial: coefficients c0 to c4 [rad] or [m] of 1, q, q^2, q^3, q^4.
    """

    name: str
    first: int
    second: int | None
    polynomial: tuple[Scalar, ...]

    def value(self, q: Any) -> Any:
        """The polynomial at the coordinate q."""
        found: Any = self.polynomial[-1]
        for coefficient in reversed(self.polynomial[:-1]):
            found = found * q + coefficient
        return found

    def slope(self, q: Any) -> Any:
        """Its derivative at the coordinate q."""
        found: Any = 0.0
        for k in range(len(self.polynomial) - 1, 0, -1):
            found = found * q + k * self.polynomial[k]
        return found


@dataclass(frozen=True)
class CouplingSpec:
    """A coupling by the names of its joints; see ``JointCoupling``.

    Attributes:
        name: how the state refers to it.
        joints: the joint that follows, and the one that it follows; one joint alone is held.
        polynomial: c0 to c4; what is missing is 0.
    """

    name: str
    joints: tuple[str, ...]
    polynomial: Sequence[Scalar] = (0.0, 1.0)


def placed_couplings(specs: Sequence[CouplingSpec], joints: Sequence[Joint]) -> tuple[JointCoupling, ...]:
    """Couplings by the indices of their joints."""
    places = {joint.name: index for index, joint in enumerate(joints)}
    return tuple(
        JointCoupling(
            spec.name,
            places[spec.joints[0]],
            places[spec.joints[1]] if len(spec.joints) > 1 else None,
            tuple(spec.polynomial),
        )
        for spec in specs
    )
