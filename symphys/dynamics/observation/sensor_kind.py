"""Kinds of sensors: each declares a quantity that formulas read by name, such as ``torso.gyro``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from functools import cached_property
from typing import Any, Literal, TypeVar

from symphys.model.joints import Joint
from symphys.model.state_layout import Layout
from symphys.model.world import World
from symphys.records import dataclass
from symphys.types import Expr

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class SensedState:
    """A state, and what sensors remember of the step before it.

    Attributes:
        world: what is simulated.
        x: (nx,) the state; see ``Layout``.
        before: by name, parts of the state and inputs one step before, as far as they are known.
        dt: the time step [s].
    """

    world: World
    x: Expr
    before: Mapping[str, Expr] = field(default_factory=dict)
    dt: Expr = 1.0
    _made: dict[Any, Any] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def layout(self) -> Layout:
        """Return the columns of the parts of the state."""
        return Layout(self.world)

    def part(self, name: str) -> Expr:
        """Return the part of the state that has this name."""
        return self.x[self.layout[name]]

    def shared(self, make: Callable[[SensedState], T]) -> T:
        """Return ``make(self)``, which is called once for all sensors that need it."""
        if make not in self._made:
            self._made[make] = make(self)
        found: T = self._made[make]
        return found


@dataclass(frozen=True)
class MjcfSensor:
    """MuJoCo's sensor with the same reading.

    Attributes:
        word: its element in MJCF.
        at: what it is attached to: a "joint" with one coordinate, a "body" (centre of mass, principal axes), an "xbody"
            (the body's own axes), a "site"; "axes", a site with the owner's axes anywhere on its body; or "frame", a
            site with the owner's axes at the owner's own point.
    """

    word: str
    at: Literal["joint", "body", "xbody", "site", "axes", "frame"]


@dataclass(frozen=True)
class SensorKind:
    """A quantity that formulas read of every body, joint or site that has it, as ``owner.key``.

    Attributes:
        key: the last part of its name.
        owner: what has it.
        about: its meaning, in a line of docs/formulas.md.
        read: returns its value (size,) in a state, of a ``Body``, ``Joint`` or ``Site``.
        unit: of its components; empty for pure numbers. Of a joint that slides: ``sliding_unit``, if that is given.
        size: how many components; None: one for each coordinate of the joint.
        axes: those that a vector is expressed in: the world's, or its owner's own; empty where it is no vector.
        has: whether a body, joint or site has this quantity.
        before: returns the names of the parts of the state and of the inputs one step before that ``read`` needs.
        parameters: names of the world's numbers that it depends on beside the state.
        ahead: whether it is known half a step ahead, where force laws are evaluated.
        kept: whether it reads forces of joints, which a state keeps only where steps have a warm start.
        mjcf: the sensor of MuJoCo with the same reading; None where there is none.
    """

    key: str
    owner: Literal["body", "joint", "site"]
    about: str
    read: Callable[[SensedState, Any], Expr]
    unit: str = ""
    sliding_unit: str | None = None
    size: int | None = 3
    axes: Literal["world", "own", ""] = ""
    has: Callable[[Any], bool] = lambda owner: True
    before: Callable[[World, Any], tuple[str, ...]] = lambda world, owner: ()
    parameters: frozenset[str] = frozenset()
    ahead: bool = True
    kept: bool = False
    mjcf: MjcfSensor | None = None

    def unit_of(self, owner: Any) -> str:
        """Return the unit of its components, of this body, joint or site."""
        slides = isinstance(owner, Joint) and any(not coordinate.turns for coordinate in owner.kind.coordinates)
        return self.sliding_unit if slides and self.sliding_unit is not None else self.unit
