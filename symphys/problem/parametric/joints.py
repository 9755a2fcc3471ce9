"""A joint of a problem: bodies by name, numbers that variables may replace."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

from symphys.model.joints import Joint, JointFrame, Kind, Limits, Motor, Spring
from symphys.model.joints.joint import joint_numbers
from symphys.model.numbers import Number, numbers_of
from symphys.model.scalar import Scalar
from symphys.problem.parametric.parts import Numbers, PairRule, Value
from symphys.records import dataclass

Part = TypeVar("Part", bound=Motor | Spring)
OWN = tuple(numbers_of(Joint))
"""Numbers of the joint itself, parameters where they are not 0."""


@dataclass(frozen=True)
class ParametricJoint:
    """A joint.

    Attributes:
        name: unique among bodies, static surfaces, joints and variables.
        kind: what it locks.
        first, second: names of the body whose coordinates count and of what they are measured against; None: the world.
        frames: of the first and of the second.
        motor, limits, spring: along every coordinate.
        armature, friction: see ``Joint``.
        frequency: natural frequency of a compliant joint [Hz]; 0: rigid.
        damping: its damping ratio.
        collide: whether the two bodies may touch each other.
        start: the coordinates at the start; empty: all 0, as the bodies lie in the file.
    """

    name: str
    kind: Kind
    first: str
    second: str | None
    frames: tuple[JointFrame, JointFrame]
    motor: Motor | None
    limits: Limits
    spring: Spring | None
    frequency: float = 0.0
    damping: float = 1.0
    collide: bool = False
    start: tuple[float, ...] = ()
    armature: float = 0.0
    friction: float = 0.0

    @property
    def apart(self) -> PairRule | None:
        """Return the [[pair]] rule by which its bodies do not touch each other; None if they may."""
        if self.collide or self.second is None:
            return None
        return PairRule(f"{self.second}-{self.first}", frozenset((self.first, self.second)), False, {})

    @property
    def anchor(self) -> str:
        """The parameter that says where the joint is on its second side, (3,) [m]: body frame, or the world's."""
        return f"{self.name}.anchor"

    @property
    def numbers(self) -> Mapping[str, Number]:
        """Return what is known of its numbers, by key."""
        return {**joint_numbers(self.kind, self.motor, self.spring), "anchor": Number("m")}

    def parameters(self) -> dict[str, Numbers]:
        """Return names and values of parameters: of kind, motor, spring, the anchor, armature and friction if not 0."""
        parts = [part for part in (self.motor, self.spring) if part is not None]
        found = {f"{self.name}.{key}": number for part in parts for key, number in given(part).items()}
        found |= {f"{self.name}.{key}": number for key, number in self.kind.numbers.items()}
        found |= {f"{self.name}.{key}": getattr(self, key) for key in OWN if getattr(self, key)}
        return found | {self.anchor: self.frames[1].point}

    def valued(self, places: Mapping[str, int], value: Value) -> Joint:
        """The joint with its parameters' values; ``places`` has the indices of bodies."""
        return Joint(
            name=self.name,
            kind=self.kind.valued({key: value(f"{self.name}.{key}") for key in self.kind.numbers}),
            first=places[self.first],
            second=None if self.second is None else places[self.second],
            frames=(self.frames[0], replace(self.frames[1], point=value(self.anchor))),
            motor=None if self.motor is None else self._valued(self.motor, value),
            limits=self.limits,
            spring=None if self.spring is None else self._valued(self.spring, value),
            frequency=self.frequency,
            damping=self.damping,
            start=self.start,
            **{key: value(f"{self.name}.{key}") for key in OWN if getattr(self, key)},
        )

    def _valued(self, part: Part, value: Value) -> Part:
        """Motor or spring with its parameters' values."""
        return replace(part, **{key: value(f"{self.name}.{key}") for key in given(part)})


def given(part: Motor | Spring) -> dict[str, Scalar]:
    """The numbers that there are."""
    values = {key: getattr(part, key) for key in numbers_of(part)}
    return {key: value for key, value in values.items() if value is not None}
