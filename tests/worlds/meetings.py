"""Pairs of shapes under test: the rules of collision as numeric functions, and bodies that move numerically."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq
from tools.distances import Solid, distance

from symphys.dynamics.collision import collide
from symphys.dynamics.collision.contact_geometry import Displacement
from symphys.dynamics.collision.predicted_path import PredictedPath, at_rest
from symphys.maths import rotation
from symphys.model.shapes import Box, Capsule, Convex, Cylinder, Ellipsoid, Sphere, Surface
from symphys.types import Array

WIDTHS = {"sphere": 1, "capsule": 2, "box": 3, "cylinder": 2, "ellipsoid": 3, "convex": 0}
"""How many numbers the size of a shape has."""
PLACE, MOTION = 7, 19
"""Numbers of a place on a body (centre, orientation) and of a body's motion over the step."""
HULL = tuple(map(tuple, np.random.default_rng(5).normal(size=(24, 3)) * [0.3, 0.2, 0.25]))
"""Points of ``convex``, which has no sizes."""
STILL = np.array([0, 0, 0, 1, 0, 0, 0] + [0] * 12, float)


def shape(kind: str, size: Any, place: Any) -> Any:
    """A shape from the numbers of its size and place; a casadi column each, or arrays."""
    numbers = [size[i] for i in range(WIDTHS[kind])]
    centre, orientation = tuple(place[i] for i in range(3)), tuple(place[i] for i in range(3, 7))
    if kind == "sphere":
        return Sphere(numbers[0], centre)
    if kind == "capsule":
        return Capsule(numbers[0], numbers[1], centre, orientation)
    if kind == "cylinder":
        return Cylinder(numbers[0], numbers[1], centre, orientation)
    if kind == "ellipsoid":
        return Ellipsoid(tuple(numbers), centre, orientation)
    if kind == "convex":
        return Convex(HULL, centre, orientation)
    return Box(tuple(numbers), centre, orientation)


def course(motion: Any, dt: Any) -> PredictedPath:
    """A body's course from position, orientation, velocity, acceleration and the same of its turning."""
    p, q, v, a, w, alpha = (motion[i:j] for i, j in ((0, 3), (3, 7), (7, 10), (10, 13), (13, 16), (16, 19)))
    return PredictedPath(p, rotation.matrix(q), v, a, w, alpha, dt, None, None)


@dataclass(frozen=True)
class Meet:
    """What a rule says, one row a point: gap, rate, hit, time, and at that time normal and arms."""

    gap: Array
    rate: Array
    hit: Array
    time: Array
    normal: Array
    arms: tuple[Array, Array]

    @property
    def first(self) -> float:
        """The first instant at which any point touches; infinite if none does."""
        return float(self.time[self.hit > 0].min()) if (self.hit > 0).any() else np.inf


def arguments(first: str, second: str) -> list[ca.SX]:
    """Symbols for both sizes, places and motions, and dt."""
    names = (("size", WIDTHS), ("place", {}), ("motion", {}))
    lengths = {"place": PLACE, "motion": MOTION}
    found = [
        ca.SX.sym(f"{name}{k}", lengths.get(name) or WIDTHS.get(kind, 0))
        for k, kind in enumerate((first, second))
        for name, _ in names
    ]
    return [*found, ca.SX.sym("dt")]


def contacts(first: str, second: str, symbols: list[ca.SX], static: bool, surface: Surface | None) -> list[Any]:
    """The contacts of the two, symbolically; ``static``: the second does not move, and its frame is the world's."""
    dt = symbols[6]
    one = shape(first, symbols[0], symbols[1])
    other = surface or shape(second, symbols[3], symbols[4])
    b = at_rest(dt) if static or surface is not None else course(symbols[5], dt)
    return collide(one, other, course(symbols[2], dt), b)


@cache
def rule(first: str, second: str, static: bool = False, surface: Surface | None = None) -> ca.Function:
    """(sizes, places, motions, dt) -> gap, rate, hit, time, normals, arms of the first, arms of the second."""
    symbols = arguments(first, second)
    found = contacts(first, second, symbols, static, surface)
    frames = [contact.geometry.frame(contact.time) for contact in found]
    columns = [ca.vertcat(*(getattr(c, name) for c in found)) for name in ("gap", "rate", "hit", "time")]
    parts = zip(*((f.normal, *f.arms) for f in frames), strict=True)
    columns += [ca.horzcat(*(ca.densify(each) for each in column)).T for column in parts]
    return ca.Function("meet", symbols, [ca.densify(ca.SX(column)) for column in columns])


@cache
def later(first: str, second: str, static: bool = False, surface: Surface | None = None) -> ca.Function:
    """(sizes, places, motions, dt, both displacements (6,)) -> gaps at the end of the step."""
    symbols = arguments(first, second)
    shifts = [ca.SX.sym("shift_a", 6), ca.SX.sym("shift_b", 6)]
    found = contacts(first, second, symbols, static, surface)
    ends = [c.geometry.gap_after(*(Displacement(s[:3], s[3:]) for s in shifts)) for c in found]
    return ca.Function("later", [*symbols, *shifts], [ca.densify(ca.vertcat(*ends))])


def met(function: ca.Function, *numbers: Any) -> Meet:
    """The numbers of a rule."""
    gap, rate, hit, time, normal, one, other = (np.array(part) for part in function.call([ca.DM(n) for n in numbers]))
    return Meet(gap[:, 0], rate[:, 0], hit[:, 0], time[:, 0], normal, (one, other))


def matrix(q: Array) -> Array:
    """(3, 3) of a unit quaternion."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def turned(vector: Array) -> Array:
    """(3, 3): the rotation by a vector [rad], Rodrigues."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)


@dataclass(frozen=True)
class Thing:
    """A shape on a moving body: its kind, size, place on the body and the body's motion, as numbers."""

    kind: str
    size: Array
    place: Array = field(default_factory=lambda: STILL[:7])
    motion: Array = field(default_factory=lambda: STILL)

    def numbers(self) -> tuple[Array, Array, Array]:
        """For ``rule``."""
        return self.size, self.place, self.motion

    def centre_of_mass(self, t: float) -> Array:
        """(3,) at time t."""
        m = self.motion
        return np.asarray(m[0:3] + t * m[7:10] + t * t / 2 * m[10:13])

    def at(self, t: float) -> Solid:
        """The shape at time t: the body turns by t w + t^2/2 alpha, right to third order of t."""
        m = self.motion
        body = turned(t * m[13:16] + t * t / 2 * m[16:19]) @ matrix(m[3:7])
        axes = body @ matrix(self.place[3:7])
        radius = float(self.size[0]) if self.kind != "box" else 0.0
        halves = {"sphere": np.zeros(3), "box": self.size, "capsule": np.array([0, 0, self.size[-1]])}[self.kind]
        return Solid(self.centre_of_mass(t) + body @ self.place[:3], axes, halves, radius)


def random_turn(rng: np.random.Generator) -> Array:
    """A unit quaternion."""
    q = rng.normal(size=4)
    return np.asarray(q / np.linalg.norm(q))


def random_thing(rng: np.random.Generator, kind: str, static: bool = False) -> Thing:
    """A shape of random size, placed and turned at random on a body that is turned at random and does not move."""
    size = rng.uniform(0.1, 0.5, WIDTHS[kind])
    place = np.concatenate([rng.uniform(-0.3, 0.3, 3), random_turn(rng)])
    if static:
        return Thing(kind, size, place)
    return Thing(kind, size, place, np.concatenate([rng.uniform(-1, 1, 3), random_turn(rng), np.zeros(12)]))


def moved_to(a: Thing, b: Thing, gap: float, rng: np.random.Generator) -> Thing:
    """The first thing, shifted in a random direction until it is ``gap`` away from the second."""
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    start = b.at(0).centre - a.at(0).centre
    share = brentq(lambda t: distance(shifted(a, start + t * way).at(0), b.at(0)) - gap, 0.0, 4.0, xtol=1e-14)
    return shifted(a, start + share * way)


def shifted(a: Thing, by: Array) -> Thing:
    """The same thing elsewhere."""
    return replace(a, motion=np.concatenate([a.motion[:3] + by, a.motion[3:]]))


def flying(a: Thing, velocity: Any, spin: Any = (0, 0, 0), acceleration: Any = (0, 0, 0)) -> Thing:
    """The same thing in motion."""
    return replace(a, motion=np.concatenate([a.motion[:7], velocity, acceleration, spin, np.zeros(3)]))
