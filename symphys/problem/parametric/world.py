"""The world of a problem: bodies, statics and who touches whom under which law, with numbers that may be replaced.

The rule for a pair of surfaces: what its [[pair]] table states holds. Else friction and restitution are the product
of what the two surfaces state, torsion and rolling (lengths) their sum. Where neither states it, [contact] holds.
A [[pair]] of two surfaces goes before one of a surface and a group, and that one before one of groups.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from symphys.model.body import Body, Site
from symphys.model.joints import Joint
from symphys.model.joints.coupling import CouplingSpec, placed_couplings
from symphys.model.numbers import Number
from symphys.model.shapes import Scalar, Static
from symphys.model.world import Law, Pair, Side, Statements, World, points_of
from symphys.problem.parametric.collision_filter import CollisionFilter
from symphys.problem.parametric.joints import ParametricJoint
from symphys.problem.parametric.parts import (
    COEFFICIENTS,
    LAW,
    Numbers,
    PairRule,
    ParametricBody,
    ParametricSite,
    ParametricStatic,
    Part,
    Value,
    less,
    stated,
)
from symphys.records import dataclass
from symphys.types import Array

CONTACT = "contact"
"""What the law of [contact] is called among parameters."""


@dataclass(frozen=True)
class ParametricWorld:
    """Everything that a world is built from.

    Attributes:
        bodies, statics, pairs: in the file's order; of the statics first the ground, then planes, blocks, terrain.
        contact: the law where nothing else is stated.
        gravity: (3,) [m/s^2].
        joints: in the file's order.
        couplings, sites: likewise.
    """

    bodies: tuple[ParametricBody, ...]
    statics: tuple[ParametricStatic, ...]
    pairs: tuple[PairRule, ...]
    contact: Law
    gravity: tuple[float, float, float]
    joints: tuple[ParametricJoint, ...] = ()
    couplings: tuple[CouplingSpec, ...] = ()
    sites: tuple[ParametricSite, ...] = ()

    def parameters(self) -> dict[str, Array]:
        """Return every parameter: (1,), or (3,) for gravity, the size of a box and the place of a block."""
        found: dict[str, Numbers] = {"gravity": self.gravity, **self.contact_parameters}
        for part in self.owners_of_numbers:
            found |= part.parameters()
        return {name: np.atleast_1d(np.array(numbers, float)) for name, numbers in found.items()}

    @cached_property
    def numbers(self) -> dict[str, Number]:
        """Return the declarations of the ``parameters``, by name."""
        found = {"gravity": Number("m/s^2", phase="start")}
        found |= {name: COEFFICIENTS[name.rpartition(".")[2]] for name in self.contact_parameters}
        for part in self.owners_of_numbers:
            found |= {name: part.numbers[name.removeprefix(f"{part.name}.")] for name in part.parameters()}
        return found

    @property
    def owners_of_numbers(self) -> tuple[Part | PairRule | ParametricJoint, ...]:
        """Bodies, statics, pairs and joints."""
        return (*self.parts, *self.pairs, *self.joints)

    @cached_property
    def contact_parameters(self) -> dict[str, Numbers]:
        """Return the parameters of [contact]; damping is one only where some contact is soft."""
        soft = self.contact.soft or any(pair.states.get("frequency") for pair in self.pairs)
        known = stated(vars(self.contact))
        return {f"{CONTACT}.{key}": number for key, number in known.items() if soft or key != "damping"}

    def starts(self) -> dict[str, Array]:
        """Return the start coordinates and rates of joints that variables may set, (coordinates,) each.

        ``hip.start`` are the coordinates [rad] or [m]. ``hip.start_rate`` are rates [rad/s] or [m/s] that come on top
        of those that the velocities of the bodies give: 0, as no file states them.
        """
        found = {}
        for joint in self.joints:
            count = len(joint.kind.coordinates)
            if count:
                found[f"{joint.name}.start"] = np.array(joint.start or (0.0,) * count)
                found[f"{joint.name}.start_rate"] = np.zeros(count)
        return found

    def world(self, overrides: Mapping[str, Any]) -> World:
        """The world with some parameters replaced; KeyError for a name that is none."""
        nominal = self.parameters()
        for name in overrides:
            if name not in nominal:
                raise KeyError(f"{name!r} is no parameter; there are {', '.join(nominal)}")

        def value(name: str) -> Any:
            count = nominal[name].size
            if name not in overrides:
                return float(nominal[name][0]) if count == 1 else tuple(nominal[name].tolist())
            return overrides[name] if count == 1 else tuple(overrides[name][i] for i in range(count))

        bodies = tuple(body.valued(overrides, value) for body in self.bodies)
        statics = tuple(static.valued(value) for static in self.statics)
        places = {body.name: index for index, body in enumerate(bodies)}
        joints = tuple(self._joint(joint, places, value) for joint in self.joints)
        return World(
            bodies,
            statics,
            self._pairs(bodies, statics, value),
            value("gravity"),
            joints,
            placed_couplings(self.couplings, joints),
            tuple(self._site(site, places, value) for site in self.sites),
        )

    def _joint(self, joint: ParametricJoint, places: Mapping[str, int], value: Value) -> Joint:
        """A joint with its parameters' values, and its frames from the centres of mass."""
        made = joint.valued(places, value)
        ends = zip(made.frames, (joint.first, joint.second), strict=True)
        first, second = (replace(frame, point=self._shifted(frame.point, body, value)) for frame, body in ends)
        return replace(made, frames=(first, second))

    def _site(self, site: ParametricSite, places: Mapping[str, int], value: Value) -> Site:
        """A site on its body, from the centre of mass."""
        place = None if site.body is None else places[site.body]
        return Site(site.name, place, self._shifted(site.position, site.body, value), site.orientation, site.motor)

    def _shifted(self, point: Sequence[Scalar], body: str | None, value: Value) -> tuple[Scalar, ...]:
        """(3,) from a body's centre of mass, where the file has it from the origin of the body's frame."""
        part = None if body is None else self._named[body]
        return less(point, part.centre(value)) if isinstance(part, ParametricBody) else tuple(point)

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Bodies, then statics."""
        return (*self.bodies, *self.statics)

    @cached_property
    def collision_pairs(self) -> tuple[tuple[int, int], ...]:
        """Return every two parts that may touch, as places in ``parts``: both allow it, and no rule forbids it."""
        return tuple(CollisionFilter(self.parts, (*self.pairs, *self.jointed)).pairs())

    @cached_property
    def jointed(self) -> tuple[PairRule, ...]:
        """Return [[pair]] rules by which jointed bodies do not touch each other."""
        return tuple(joint.apart for joint in self.joints if joint.apart is not None)

    def _pairs(self, bodies: tuple[Body, ...], statics: tuple[Static, ...], value: Value) -> tuple[Pair, ...]:
        """Return the pairs in the order of ``world.all_pairs``: against statics, then against later bodies."""
        laws = {(i, j): self.law(self.parts[i].name, self.parts[j].name, value) for i, j in self.collision_pairs}
        sides = [[Side(i, k) for k in range(len(body.shapes))] for i, body in enumerate(bodies)]
        sides += [[Side(None, k)] for k in range(len(statics))]
        both = [(a, b, laws[i, j]) for i, j in self.collision_pairs for a in sides[i] for b in sides[j]]

        def place(entry: tuple[Side, Side, Law]) -> tuple[int, ...]:
            a, b, _ = entry
            return (
                (0, a.body or 0, a.shape, 0, b.shape) if b.body is None else (1, a.body or 0, a.shape, b.body, b.shape)
            )

        both.sort(key=place)
        return tuple(pair for a, b, law in both for pair in points_of(bodies, statics, a, b, law))

    def owners(self, pair: Pair) -> tuple[str, str]:
        """The names of the two bodies, or of the body and the static surface."""
        sides = (pair.first, pair.second)
        first, second = (
            self.statics[side.shape].name if side.body is None else self.bodies[side.body].name for side in sides
        )
        return first, second

    def lets(self, a: str, b: str) -> bool:
        """Whether ``a`` lets ``b`` touch it, as far as collides_with goes."""
        named, other = self._named[a].collides_with, self._named[b]
        return named is None or b in named or other.group in named

    def pair(self, a: str, b: str) -> PairRule | None:
        """The [[pair]] table that holds for the two surfaces, if there is one."""
        g, h = self._named[a].group, self._named[b].group
        for names in ((a, b), (a, h), (g, b), (g, h)):
            found = self._tables.get(frozenset(names))
            if found is not None:
                return found
        return None

    @cached_property
    def _named(self) -> dict[str, Part]:
        return {part.name: part for part in self.parts}

    @cached_property
    def _tables(self) -> dict[frozenset[str | None], PairRule]:
        return {frozenset(pair.between): pair for pair in self.pairs}

    def law(self, a: str, b: str, value: Value) -> Law:
        """The contact law of the two by the rule above, with the values of what is a parameter."""
        return Law.of(self.statements(a, b, value))

    def statements(self, a: str, b: str, value: Value | None = None) -> Statements:
        """Return the law that tables state for the two, with values of parameters; None: as the file has them."""
        return {
            key: [(owner, value(f"{owner}.{key}") if value and varies else number) for owner, number, varies in sources]
            for key, sources in self.sources(a, b).items()
        }

    def sources(self, a: str, b: str) -> dict[str, list[tuple[str, Any, bool]]]:
        """Map coefficients to who states them (a pair, [contact], surfaces), the value, and if it is a parameter."""
        pair = self.pair(a, b)
        found: dict[str, list[tuple[str, Any, bool]]] = {}
        for key in LAW:
            found[key] = [(CONTACT, getattr(self.contact, key), f"{CONTACT}.{key}" in self.contact_parameters)]
            sides = [self._named[name] for name in (a, b) if key in self._named[name].states]
            tables = [pair] if pair and key in pair.states else sides
            if tables:
                found[key] = [(each.name, each.states[key], key in stated(each.states)) for each in tables]
        return found
