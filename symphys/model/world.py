"""The world of the physics: bodies, static surfaces, and the pairs of their surfaces with contact laws.

Everything here is frozen. A number may be a float or a casadi symbol: a symbol makes the step a function of it,
so a mass, a radius or a coefficient of friction becomes a parameter with exact derivatives.
SI units; vectors are in world coordinates unless a field says "body frame".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field, fields, replace
from math import prod
from operator import itemgetter
from types import MappingProxyType
from typing import Any

import casadi as ca
import numpy as np

from symphys.errors import SymphysError
from symphys.model.body import Body, Site
from symphys.model.joints import Joint
from symphys.model.joints.coupling import JointCoupling
from symphys.model.joints.placing import jointed
from symphys.model.joints.specs import JointSpec
from symphys.model.numbers import declare, table_key
from symphys.model.scalar import Scalar, is_zero
from symphys.model.shapes import Static, Surface, contact_points, surface
from symphys.records import dataclass
from symphys.suggest import hint, quote
from symphys.types import Array

Vector = Sequence[Any]
"""three of them"""

UNEQUAL = 20.0
"""Ratio of masses from which on plain sweeps are too slow, so that a step searches along its impulses."""
GRAVITY = (0.0, 0.0, -9.81)
NOTHING: Mapping[Any, Any] = MappingProxyType({})


@dataclass(frozen=True)
class Law:
    """The contact law of two surfaces.

    [contact], [[pair]] and the tables of surfaces have a key for each field, by its metadata; see ``declare``. Surfaces
    state those with ``combine``, which makes one value of those of two surfaces.

    Attributes:
        friction: Coulomb's coefficient mu; |tangential impulse| <= mu * normal impulse, on the exact disc. Two numbers:
            mu along ``friction_direction`` and across it; tangential impulses are in the ellipse with these half axes,
            times the normal impulse.
        restitution: Newton's e in [0, 1].
        torsion: radius [m] of the torque about the normal: |torque| <= torsion * normal force.
        rolling: radius [m] of the torque across the normal: |torque| <= rolling * normal force.
        frequency: [Hz] of a soft contact (Catto, GDC 2011); 0 is a rigid contact. A soft contact has no restitution.
        damping: damping ratio of a soft contact.
        friction_direction: (3,) of any length but 0; what of it lies across the contact's normal counts.
        friction_frame: the body in whose frame that direction is, and with which it turns; None: the world's axes.
        friction_side: which of the two bodies of a pair that is, 0 or 1; worlds set it.
    """

    friction: Scalar | tuple[Scalar, Scalar] = field(
        default=0.5,
        metadata={
            "combine": lambda both: _product(*both),
            **declare(
                "",
                "Coulomb coefficient, or [along, across] friction_direction",
                "friction",
                least=0.0,
                phase="impulse",
            ),
        },
    )
    restitution: Scalar = field(
        default=0.0,
        metadata={
            "combine": prod,
            **declare(
                "",
                "ratio of normal speeds after and before an impact",
                least=0.0,
                most=1.0,
                phase="start",
            ),
        },
    )
    torsion: Scalar = field(
        default=0.0,
        metadata={
            "combine": sum,
            **declare("m", "resistance to spinning about the normal, a lever arm", least=0.0, structural=True),
        },
    )
    rolling: Scalar = field(
        default=0.0,
        metadata={"combine": sum, **declare("m", "rolling resistance, a lever arm", least=0.0, structural=True)},
    )
    frequency: Scalar = field(
        default=0.0,
        metadata=declare(
            "Hz", "natural frequency of a soft contact; 0: rigid", least=0.0, exceeds=True, structural=True
        ),
    )
    damping: Scalar = field(default=1.0, metadata=declare("", "damping ratio of a soft contact; default 1", least=0.0))
    friction_direction: tuple[float, ...] | None = field(
        default=None,
        metadata={
            "combine": itemgetter(0),
            **table_key(
                "nonzero direction",
                "direction of the first of two coefficients: in the body's frame for a body, otherwise in world axes",
            ),
        },
    )
    friction_frame: str | None = field(
        default=None,
        metadata=table_key("identifier", "the body whose frame friction_direction refers to; default: world axes"),
    )
    friction_side: int | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        """Lists become tuples."""
        for key in ("friction", "friction_direction"):
            if isinstance(getattr(self, key), list):
                object.__setattr__(self, key, tuple(getattr(self, key)))

    @property
    def soft(self) -> bool:
        """Whether the contact is a spring and damper; a matter of structure, so never a symbol's value."""
        return not is_zero(self.frequency)

    @property
    def rubs(self) -> bool:
        """Whether the contact has friction across its normal."""
        return not all(map(is_zero, _both(self.friction)))

    @property
    def spins(self) -> bool:
        """Whether the contact resists spinning or rolling."""
        return not (is_zero(self.torsion) and is_zero(self.rolling))

    @property
    def largest_friction(self) -> Scalar:
        """The largest friction force per unit of normal force, in any direction."""
        one, other = _both(self.friction)
        return one if one is other else ca.fmax(one, other)

    def between(self, names: Sequence[str]) -> Law:
        """The law of a pair of bodies, by their names; without the name of what stands still."""
        frame = self.friction_frame if self.friction_frame in names else None
        return replace(self, friction_frame=frame, friction_side=None if frame is None else names.index(frame))

    @classmethod
    def of(cls, stated: Statements) -> Law:
        """The law of two surfaces: what one table states holds, and what two state is combined.

        A direction that a surface states is in the frame of that surface.
        """
        found = {}
        for key, sources in stated.items():
            numbers = [number for _, number in sources]
            found[key] = numbers[0] if len(numbers) == 1 else COMBINE[key](numbers)
        if found.get("friction_direction") is not None and not _frame_is_stated(stated):
            found["friction_frame"] = stated["friction_direction"][0][0]
        if not isinstance(found.get("friction"), tuple):  # one number, as a pair may state it, has no direction
            found |= dict.fromkeys(("friction_direction", "friction_frame"))
        return cls(**found)

    def mujoco_friction(self, normal: Vector | None) -> MujocoFriction:
        """The friction of the contact as MuJoCo has it.

        Args:
            normal: (3,) unit vector of the contact; None where MuJoCo's contact frame turns with a body.
        """
        rolls, twists = not is_zero(self.rolling), not is_zero(self.torsion)
        directions = 6 if rolls else 4 if twists else 3 if self.rubs else 1
        turns, (along, across) = self._turns_in_mujoco(normal), _both(self.friction)
        if turns is None:
            along = across = self.largest_friction
        first, second = (across, along) if turns else (along, across)
        departure = "" if turns is not None else NO_DIRECTION
        return MujocoFriction(directions, (first, second, self.torsion, self.rolling, self.rolling), departure)

    def _turns_in_mujoco(self, normal: Vector | None) -> bool | None:
        """Tell whether the direction of friction is MuJoCo's second tangent, not the first; None if it is neither."""
        if not isinstance(self.friction, tuple) or self.friction_direction is None:
            return False
        if normal is None or self.friction_side is not None:
            return None
        first = mujoco_tangent(normal)
        one, other = (
            abs(float(np.dot(tangent, self.friction_direction))) for tangent in (first, np.cross(normal, first))
        )
        return False if other < ROUNDING * one else True if one < ROUNDING * other else None


def mujoco_tangent(normal: Any) -> Array:
    """(3,) unit vector: the first tangent of a contact in MuJoCo whose frame follows from its normal (3,) alone.

    It is the part of the y axis across the normal; of the z axis where the normal is nearer than 60 degrees to y.
    """
    n = np.array(normal, float)
    axis = np.array([0.0, 1.0, 0.0]) if abs(n[1]) < 0.5 else np.array([0.0, 0.0, 1.0])
    across = axis - n * (n @ axis)
    return np.asarray(across / np.linalg.norm(across))


def _both(friction: Any) -> tuple[Any, Any]:
    """Friction along and across a direction; one coefficient twice."""
    return friction if isinstance(friction, tuple) else (friction, friction)


def _product(one: Any, other: Any) -> Any:
    """The friction of two surfaces."""
    if not isinstance(one, tuple) and not isinstance(other, tuple):
        return prod((one, other))
    return tuple(a * b for a, b in zip(_both(one), _both(other), strict=True))


def _frame_is_stated(stated: Statements) -> bool:
    """Whether the table that states the direction of friction also states in whose frame it is."""
    owners = [stated.get(key, [("", None)])[0][0] for key in ("friction_direction", "friction_frame")]
    return owners[0] == owners[1]


NO_DIRECTION = (
    "friction along and across a direction that is no tangent of MuJoCo's contact, as y and x are on the ground; "
    "the larger coefficient holds in all directions"
)
ROUNDING = 1e-9

Statements = Mapping[str, Sequence[tuple[str, Any]]]
"""By coefficient: the tables that state it for two surfaces (a pair, [contact], one surface or both), and its value."""
COMBINE: dict[str, Callable[[list[Any]], Any]] = {
    each.name: each.metadata["combine"] for each in fields(Law) if "combine" in each.metadata
}
"""The coefficients that surfaces state, and what makes one of the numbers of two surfaces."""


@dataclass(frozen=True)
class MujocoFriction:
    """Friction of a contact in MuJoCo.

    Attributes:
        directions: in how many a contact acts (condim): the normal, two across, about the normal, two rolling.
        coefficients: (5,) along the two tangents of its contact frame, torsion [m], rolling [m] about both tangents.
        departure: what differs there; empty if nothing does.
    """

    directions: int
    coefficients: tuple[Scalar, ...]
    departure: str = ""


def contradictions(names: Sequence[str], stated: Statements) -> Iterator[tuple[str, str]]:
    """Return contradictions of a law for two surfaces: the coefficient at fault, and a message with the remedy."""
    law, both = Law.of(stated), " and ".join(sorted(names)) + ": " * bool(names)
    if law.soft and law.restitution:
        text = f"a contact is either soft (frequency {law.frequency:g} Hz) or has restitution ({law.restitution:g})"
        yield "frequency", f"{both}{text}; leave one out, or make one of them 0 for these two in a [[pair]] table"
    owners = {key: [owner for owner, _ in sources] for key, sources in stated.items()}
    directions = [owner for owner, direction in stated["friction_direction"] if direction is not None]
    overridden = not {*owners["friction"]} <= {*names, *directions, "contact"}  # by a pair: what surfaces state waits
    if isinstance(law.friction, tuple) and not directions:
        yield "friction", f"{both}two numbers are friction along and across friction_direction; give that too"
    if not isinstance(law.friction, tuple) and directions and not overridden:
        yield "friction_direction", f"{both}has no effect with one number of friction; give it two: [along, across]"
    if len(directions) > 1:
        text = "both surfaces state a direction of friction; state friction and friction_direction of these two in a"
        yield "friction_direction", f"{both}{text} [[pair]] table"
    frame = stated["friction_frame"][0][1]
    if frame is not None and not (directions and _frame_is_stated(stated)):
        yield "friction_frame", f"{both}has no effect without a friction_direction beside it; give that too"
    elif frame is not None and frame not in names:
        yield "friction_frame", f"{both}must be the name of one of these two, not {quote(frame)}"


@dataclass(frozen=True)
class Side:
    """A side of a pair: a body's shape, or (``body`` None) the static surface with index ``shape``."""

    body: int | None
    shape: int


@dataclass(frozen=True)
class Pair:
    """A point where two surfaces may touch.

    Attributes:
        name: unique; surfaces that may touch in several points add its number: ``box-ground:3``.
        first: always belongs to a body.
        second: a later body, or static.
        law: how they act on each other.
        point: which of the points of the two.
    """

    name: str
    first: Side
    second: Side
    law: Law
    point: int = 0


@dataclass(frozen=True)
class World:
    """Bodies, static surfaces, the pairs that may touch, and gravity.

    Attributes:
        bodies: the order gives the state's columns.
        statics: planes, fixtures, terrain.
        pairs: every point of contact that is looked at, those of two surfaces one after the other; ``all_pairs``.
        gravity: (3,) [m/s^2].
        joints: what holds bodies together.
        couplings: coordinates that follow others.
        sites: named points.
        scheduled: inputs of one number each on which other numbers of the world depend, as symbols by name: those of
            the contacts, motors, springs and gravity that change from step to step.
    """

    bodies: tuple[Body, ...]
    statics: tuple[Static, ...] = ()
    pairs: tuple[Pair, ...] = ()
    gravity: tuple[Scalar, ...] = GRAVITY
    joints: tuple[Joint, ...] = ()
    couplings: tuple[JointCoupling, ...] = ()
    sites: tuple[Site, ...] = ()
    scheduled: tuple[tuple[str, Any], ...] = ()

    def body_index(self, name: str) -> int:
        """The index of the body called ``name``; KeyError if there is none."""
        for index, body in enumerate(self.bodies):
            if body.name == name:
                return index
        raise KeyError(f"no body is called {name!r}; there are {', '.join(b.name for b in self.bodies)}")

    @property
    def start(self) -> dict[str, Any]:
        """Map names such as ``ball.position`` to the start of bodies that state one; see ``Body.start``."""
        return {f"{body.name}.{key}": value for body in self.bodies for key, value in body.start.items()}

    def surface(self, side: Side) -> Surface:
        """The surface on one side of a pair."""
        return surface_of(self.bodies, self.statics, side)


@dataclass(frozen=True)
class Scheme:
    """The options of a time step; the switches exist so that a study can show what each option buys.

    Attributes:
        dt: time step [s]; an SX expression of parameters where the duration is one of them.
        sweeps: projected Gauss-Seidel sweeps over the velocity constraints.
        position_sweeps: sweeps of the position pass, which removes penetration without adding velocity.
        push_out: share of a penetration that one step removes.
        warm_start: start each step from the contact forces of the last one.
        time_of_impact: resolve the instant of each impact inside the step; without it gradients through bounces
            are wrong at any step size.
        cuts: where a body is part of several pairs, how often a step is split at an impact, so that impacts are taken
            one after the other and a blow changes the forces of lasting contacts from its instant on. Each cut adds
            up to 2.4 times the work of a step without any; without any, gradients of a ball that rolls into a cushion
            are wrong at any step size. None: 2 where a body may be hit off its centre, as boxes are, else 1.
        energy_cap: no impact raises the kinetic energy, which Newton's restitution with friction can.
        load_sharing: points of one body that lie in a plane share their load linearly, as on an elastic foundation;
            without it the share of four corners depends on all that was before, and so does friction as they turn.
        newton_start: all constraints on a few bodies are solved together by Newton's method before the sweeps. What
            several faces, wheels or feet carry is then shared by least squares, and impacts on points close together
            settle; without it the order of the sweeps decides.
        impact_friction: let friction at an impact aim at the velocity at the instant of impact.
    """

    dt: Scalar = 0.01
    sweeps: int = 10
    position_sweeps: int = 2
    push_out: float = 1.0
    warm_start: bool = True
    time_of_impact: bool = True
    impact_friction: bool = True
    cuts: int | None = None
    energy_cap: bool = True
    load_sharing: bool = True
    newton_start: bool = True


def make_world(
    bodies: Sequence[Body],
    statics: Sequence[Static] = (),
    law: Law | None = None,
    gravity: Vector = GRAVITY,
    *,
    joints: Sequence[JointSpec] = (),
    laws: Mapping[tuple[str, str], Law | None] = NOTHING,
) -> World:
    """A world where everything may touch everything, but for bodies that a joint holds together.

    Args:
        bodies: with where they begin; see ``Body.start``.
        statics: what stands still: planes, fixtures, terrain.
        law: of every contact that ``laws`` has not; default ``Law()``.
        gravity: (3,) [m/s^2].
        joints: between bodies by name, placed and directed as the bodies lie. One with a ``start`` then carries what
            hangs on it there.
        laws: of two bodies, or of a body and what stands still, by name, in any order; None where they never touch.

    Raises:
        SymphysError: names the body, joint or pair, and what would be valid.

    Example:
        >>> from symphys import Problem, simulate
        >>> from symphys.model import Body, Law, Plane, make_world
        >>> ball = Body.ball("ball", radius=0.1, mass=0.5, position=(0, 0, 1), velocity=(3, 0, 2))
        >>> crate = Body.box("crate", size=(0.4, 0.4, 0.4), density=100, position=(2, 0, 0.2))
        >>> laws = {("ball", "ground"): Law(friction=0.3, restitution=0.8)}
        >>> world = make_world([ball, crate], [Plane.ground()], Law(friction=0.6), laws=laws)
        >>> motion = simulate(Problem.from_world(world, duration=1.0))
        >>> motion["ball.position"].shape
        (101, 3)
    """
    bodies, statics = tuple(bodies), tuple(statics)
    _check_names(bodies, statics, joints)
    bodies, held = jointed(bodies, joints) if joints else (bodies, ())
    for names, each in laws.items():
        if isinstance(names, str) or len(names) != 2 or not (each is None or isinstance(each, Law)):
            raise SymphysError(f'laws: write ("ball", "ground"): Law(friction=0.5), or None, not {names!r}: {each!r}')
    own = {frozenset(names): each for names, each in laws.items()}
    own |= {frozenset(joint.between): None for joint in joints if not joint.collide}
    world = World(bodies, statics, all_pairs(bodies, statics, law or Law(), own), tuple(gravity), held)
    _check_friction(law or Law(), ())
    for names, each in laws.items():
        _check_law(world, names, each)
    return world


def all_pairs(
    bodies: Sequence[Body], statics: Sequence[Static], law: Law, laws: Mapping[frozenset[str], Law | None] = NOTHING
) -> tuple[Pair, ...]:
    """Pair every shape of every body with every static surface, then with every shape of every later body.

    ``laws`` are those of two of them by name, None where they never touch. Surfaces that no rule covers
    (``shapes.contact_points`` is 0) are left out.
    """
    sides = [Side(i, j) for i, body in enumerate(bodies) for j in range(len(body.shapes))]
    both = [(a, Side(None, k)) for a in sides for k in range(len(statics))]
    both += [(a, b) for i, a in enumerate(sides) for b in sides[i + 1 :] if a.body != b.body]
    found: list[Pair] = []
    for a, b in both:
        own = laws.get(frozenset((owner(bodies, statics, a), owner(bodies, statics, b))), law) if laws else law
        if own is not None:
            found += points_of(bodies, statics, a, b, own)
    return tuple(found)


def points_of(bodies: Sequence[Body], statics: Sequence[Static], a: Side, b: Side, law: Law) -> list[Pair]:
    """The points where two surfaces may touch."""
    count = contact_points(surface_of(bodies, statics, a), surface_of(bodies, statics, b))
    name = f"{side_name(bodies, statics, a)}-{side_name(bodies, statics, b)}"
    if law.friction_direction is not None:
        law = law.between([owner(bodies, statics, side) for side in (a, b) if side.body is not None])
    return [Pair(f"{name}:{k}" if count > 1 else name, a, b, law, k) for k in range(count)]


def surface_of(bodies: Sequence[Body], statics: Sequence[Static], side: Side) -> Surface:
    """The surface on one side of a pair."""
    return surface(statics[side.shape]) if side.body is None else bodies[side.body].shapes[side.shape]


def owner(bodies: Sequence[Body], statics: Sequence[Static], side: Side) -> str:
    """The name of the body, or of the static surface, on one side of a pair."""
    return statics[side.shape].name if side.body is None else bodies[side.body].name


def side_name(bodies: Sequence[Body], statics: Sequence[Static], side: Side) -> str:
    """``ball``; a body with several shapes adds the index of the shape: ``dumbbell[1]``."""
    if side.body is None:
        return statics[side.shape].name
    body = bodies[side.body]
    return f"{body.name}[{side.shape}]" if len(body.shapes) > 1 else body.name


def _check_names(bodies: Sequence[Body], statics: Sequence[Static], joints: Sequence[JointSpec]) -> None:
    """Bodies, what stands still and joints share one set of names."""
    seen: set[str] = set()
    for part in (*bodies, *statics, *(joint for joint in joints if isinstance(joint, JointSpec))):
        if part.name in seen:
            raise SymphysError(f"two bodies, static surfaces or joints are called {quote(part.name)}; rename one")
        seen.add(part.name)


def _check_friction(law: Law, names: Sequence[str]) -> None:
    """Two coefficients need a direction, in the world's axes or those of one of the two."""
    for key, text in contradictions(names, {key: [("law", number)] for key, number in vars(law).items()}):
        if key.startswith("friction"):
            raise SymphysError(f"law: {key}: {text}")


def _check_law(world: World, names: tuple[str, str], law: Law | None) -> None:
    """The two must exist, and touch if they have a law."""
    known = [part.name for part in (*world.bodies, *world.statics)]
    for name in names:
        if name not in known:
            raise SymphysError(f"laws: no body and no static surface is called {quote(name)}; {hint(name, known)}")
    met = {frozenset(owner(world.bodies, world.statics, side) for side in (p.first, p.second)) for p in world.pairs}
    _check_friction(law or Law(), names)
    if law is not None and frozenset(names) not in met:
        raise SymphysError(
            f"laws: {' and '.join(names)} never touch; a joint keeps its bodies apart unless collide=True"
        )
