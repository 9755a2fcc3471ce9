"""A world that was built in Python as the tables of a problem file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from symphys.errors import SymphysError
from symphys.model.body import HOLLOW_SPHERE, Body, SiteMotor
from symphys.model.heightfield import Heightfield
from symphys.model.joints import JOINTS, Joint
from symphys.model.joints.frames import MEETING_TOLERANCE
from symphys.model.joints.motor import motor_kind
from symphys.model.joints.placing import REST, PlacedJoint
from symphys.model.joints.start import State, moved_to_zero, placed_frames, spanning_tree, unmoved
from symphys.model.scalar import is_zero
from symphys.model.shapes import Fixture, Plane, Shape, Static, Terrain
from symphys.model.shapes.inertia import inertia_of, off_centre, specific
from symphys.model.state_layout import GIVEN
from symphys.model.world import Law, Side, World
from symphys.problem.parametric.parts import LAW
from symphys.types import Array

MAX_FORMULA_LENGTH = 20_000
"""Characters; beyond that an expression repeats so much that a grid of heights serves better."""
OPERATION_FORMATS: dict[int, str] = {
    ca.OP_ADD: "({} + {})",
    ca.OP_SUB: "({} - {})",
    ca.OP_MUL: "({} * {})",
    ca.OP_DIV: "({} / {})",
    ca.OP_POW: "({} ** {})",
    ca.OP_CONSTPOW: "({} ** {})",
    ca.OP_SQ: "({} ** 2)",
    ca.OP_TWICE: "(2 * {})",
    ca.OP_NEG: "(-{})",
    ca.OP_INV: "(1 / {})",
    ca.OP_ATAN2: "atan2({}, {})",
    ca.OP_FABS: "abs({})",
    ca.OP_FMIN: "min({}, {})",
    ca.OP_FMAX: "max({}, {})",
    ca.OP_ASSIGN: "{}",
} | {
    getattr(ca, f"OP_{name.upper()}"): f"{name}({{}})"
    for name in ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "sqrt", "exp", "log", "sign")
}
"""By casadi's operations, with places for their arguments."""
Start = Mapping[str, Any]
"""States by name, such as ``ball.position``; what is missing is zero, and upright."""
INERTIA_TOLERANCE = 1e-13
"""Inertias whose difference is below this share of the trace are the same."""
ZERO_TOLERANCE = 1e-9
"""Coordinates below this are 0 [rad] or [m]."""


def numbers(thing: Any) -> dict[str, float]:
    """The fields of a motor or a spring that are not None."""
    return {key: floats(value) for key, value in vars(thing).items() if value is not None}


def floats(value: Any) -> Any:
    """Plain numbers, in lists as deep as they were given; SymphysError for symbols."""
    if isinstance(value, list | tuple):
        return [floats(each) for each in value]
    if isinstance(value, ca.SX | ca.MX) and not value.is_constant():
        raise SymphysError(f"{value} is no number: give one, and let a variable of the problem set it")
    return np.asarray(value, float).tolist()


def formula_text(height: Callable[[Any, Any], Any]) -> str:
    """The formula of a function of casadi scalars x and y.

    Raises:
        SymphysError: names an operation that formulas do not have.
    """
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    made = ca.Function("height", [x, y], [ca.densify(ca.SX(height(x, y)))])
    values: dict[int, str] = {}
    text = "0"
    for k in range(made.n_instructions()):
        operation, given, out = made.instruction_id(k), made.instruction_input(k), made.instruction_output(k)
        if operation == ca.OP_OUTPUT:
            text = values[given[0]]
        elif operation == ca.OP_INPUT:
            values[out[0]] = ("x", "y")[given[0]]
        elif operation == ca.OP_CONST:
            constant = made.instruction_constant(k)
            values[out[0]] = repr(constant) if constant >= 0 else f"({constant!r})"
        elif operation not in OPERATION_FORMATS:
            raise SymphysError("it has an operation that formulas lack, such as a comparison or if_else")
        else:
            values[out[0]] = OPERATION_FORMATS[operation].format(*(values[i] for i in given))
            if len(values[out[0]]) > MAX_FORMULA_LENGTH:
                raise SymphysError(f"its formula is longer than {MAX_FORMULA_LENGTH} characters")
    return text


def world_tables(world: World, start: Start) -> dict[str, Any]:
    """The tables [world], [contact], [[pair]], [[body]], [[joint]] and those of what stands still.

    Args:
        world: of numbers, without symbols.
        start: where bodies are and how they move; what is missing is as ``world.start`` has it.

    Raises:
        SymphysError: names what a problem file cannot say.
    """
    unknown = start.keys() - {f"{body.name}.{key}" for body in world.bodies for key in GIVEN}
    if unknown:
        raise SymphysError(f"start: there is no {', '.join(sorted(unknown))}; valid: <body>.{', <body>.'.join(GIVEN)}")
    law, pairs = contact_tables(world)
    joints, start = joint_tables(world, {**world.start, **start})
    tables = {
        "world": {"gravity": floats(world.gravity)},
        "contact": law,
        "pair": pairs,
        "body": [body_table(body, start) for body in world.bodies],
        "joint": joints,
        **static_tables(world.statics),
        **attached_tables(world),
    }
    return {key: table for key, table in tables.items() if table}


def attached_tables(world: World) -> dict[str, Any]:
    """Couplings and sites, by the kind of their tables."""
    couplings = [
        {
            "name": each.name,
            "joints": [world.joints[k].name for k in (each.first, each.second) if k is not None],
            "polynomial": floats(each.polynomial),
        }
        for each in world.couplings
    ]
    sites = [
        {
            "name": site.name,
            "body": "world" if site.body is None else world.bodies[site.body].name,
            "position": floats(site.position),
            "orientation": floats(site.orientation),
            **({} if site.motor is None else {"motor": site_motor_table(site.motor)}),
        }
        for site in world.sites
    ]
    return {"coupling": couplings, "site": sites}


def site_motor_table(motor: SiteMotor) -> dict[str, Any]:
    """The keys of the motor of a site."""
    ends = {} if motor.command_range is None else {"command_range": floats(motor.command_range)}
    return {"force": floats(motor.force), "torque": floats(motor.torque), **ends}


def body_table(body: Body, start: Start) -> dict[str, Any]:
    """A body and its start; its inertia is left to the file where that would make the same of mass and shape."""
    state = {key: floats(start[f"{body.name}.{key}"]) for key in GIVEN if f"{body.name}.{key}" in start}
    parts = [
        {**size_table(shape), "centre": floats(shape.centre), "orientation": floats(shape.orientation)}
        for shape in body.shapes
    ]
    mass = floats(body.mass)
    table: dict[str, Any] = {"name": body.name, "mass": mass, **state}
    if body.massless:
        return table
    if parts:
        shape = body.shapes[0]
        alone = len(parts) == 1 and parts[0] == {**size_table(shape), "centre": [0, 0, 0], "orientation": [1, 0, 0, 0]}
        table["shape"] = size_table(shape) if alone else {"parts": parts}
        if alone and "sphere" in table["shape"] and same_inertia(body.inertia, HOLLOW_SPHERE * mass * shape.extent**2):
            table["shape"]["sphere"]["hollow"] = True
            return table
        if not off_centre(body.shapes) and same_inertia(body.inertia, inertia_of(specific(body.shapes), mass)):
            return table
    return {**table, "inertia": floats(body.inertia)}


def same_inertia(given: Any, other: Any) -> bool:
    """Whether two inertias agree up to rounding; each is a number, three moments or a (3, 3) tensor."""
    one, two = (
        value * np.eye(3) if value.ndim == 0 else np.diag(value) if value.ndim == 1 else value
        for value in (np.array(floats(each), float) for each in (given, other))
    )
    return bool(np.allclose(one, two, rtol=0, atol=INERTIA_TOLERANCE * float(np.trace(two))))


def size_table(shape: Shape) -> dict[str, Any]:
    """A shape by its sizes: ``{"box": {"size": [...]}}``."""
    return {shape.kind: {key: floats(value) for key, value in shape.sizes.items()}}


def static_tables(statics: Sequence[Static]) -> dict[str, Any]:
    """Return the static surfaces by the kind of their table."""
    found: dict[str, Any] = {"plane": [], "block": [], "terrain": []}
    for static in statics:
        if isinstance(static, Plane) and static.name == "ground" and floats(static.normal) == [0, 0, 1]:
            found["ground"] = {"height": floats(static.offset)}
        elif isinstance(static, Plane):
            found["plane"].append(
                {"name": static.name, "normal": floats(static.normal), "offset": floats(static.offset)}
            )
        elif isinstance(static, Fixture):
            place = {"position": floats(static.shape.centre), "orientation": floats(static.shape.orientation)}
            found["block"].append({"name": static.name, "shape": size_table(static.shape), **place})
        else:
            found["terrain"].append(terrain_table(static))
    return found


def terrain_table(terrain: Terrain) -> dict[str, Any]:
    """A terrain by heights on a grid, or by its formula; SymphysError for a function that is none."""
    height = terrain.height
    if isinstance(height, Heightfield):
        grid = {"heights": [list(row) for row in height.heights], "spacing": list(height.spacing)}
        return {"name": terrain.name, **grid, "origin": list(height.origin)}
    try:
        return {"name": terrain.name, "height": formula_text(height)}
    except SymphysError as error:
        text = f"its height cannot be a formula of a problem file: {error}; build it from a Heightfield"
        raise SymphysError(f"terrain {terrain.name!r}: {text}") from None


def contact_tables(world: World) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The law of most pairs, and a [[pair]] table for each two surfaces with another law, or with none."""
    laws: dict[tuple[str, str], set[Law]] = {}
    for pair in world.pairs:
        laws.setdefault((side_name(world, pair.first), side_name(world, pair.second)), set()).add(pair.law)
    for (one, other), several in laws.items():
        if len(several) > 1:
            raise SymphysError(f"{one} and {other} have {len(several)} laws; a problem file has one for both")
    stated = {names: next(iter(several)) for names, several in laws.items()}
    most = Counter(stated.values()).most_common(1)[0][0] if stated else Law()
    tables = []
    for names in candidate_pairs(world):
        law = stated.get(names)
        if law is None:
            tables.append({"between": list(names), "collide": False})
        elif law != most:
            tables.append({"between": list(names), **law_table(law)})
    return law_table(most), tables


def law_table(law: Law) -> dict[str, Any]:
    """The keys of a law; rigid contacts have no frequency and damping."""
    values = {key: getattr(law, key) for key in LAW}
    found = {
        key: value if isinstance(value, str) else floats(value) for key, value in values.items() if value is not None
    }
    return found if law.soft else {key: found[key] for key in found if key not in ("frequency", "damping")}


def candidate_pairs(world: World) -> Iterator[tuple[str, str]]:
    """Yield every two surfaces that could touch, by name; bodies that a joint connects are left out."""
    joined = {frozenset(joint.bodies) for joint in world.joints}
    for i, body in enumerate(world.bodies):
        if body.shapes:
            yield from ((body.name, static.name) for static in world.statics)
            later = [(j, world.bodies[j]) for j in range(i + 1, len(world.bodies))]
            yield from ((body.name, other.name) for j, other in later if other.shapes and {i, j} not in joined)


def side_name(world: World, side: Side) -> str:
    """The body, or what stands still, on a side of a pair."""
    return world.statics[side.shape].name if side.body is None else world.bodies[side.body].name


def joint_tables(world: World, start: Mapping[str, Any]) -> tuple[list[dict[str, Any]], Mapping[str, Any]]:
    """The [[joint]] tables, and the start as a file has it: with bodies where coordinates are 0.

    A joint with another coordinate has it as ``start``; the file's reader carries the bodies back.

    Args:
        world: of numbers.
        start: where bodies are and how they move, by name.

    Raises:
        SymphysError: names a joint that does not hold together at the start, or that a file cannot place.
    """
    if not world.joints:
        return [], start
    state = whole_state(world, start)
    placed = [placed_joint(world, joint, state) for joint in world.joints]
    tree = spanning_tree(placed)
    for named in placed:
        reason = unmoved(named, tree) if named.start else ""
        if reason:
            raise SymphysError(
                f"joint {named.name!r}: its coordinates are not 0 at the start, and it {reason}; a problem file has "
                "such joints at 0 only: place its bodies so, or give it frames that coincide there"
            )
    bent = any(joint.start for joint in placed)
    zero = moved_to_zero(placed, state) if bent else state
    tables = []
    for joint, named in zip(world.joints, placed, strict=True):
        tables.append(joint_table(world, joint, named, axes_at_zero(named, zero, bent)))
    if not bent:
        return tables, start
    moved = {name: value.tolist() for name, value in zero.items() if name in start or not at_rest(name, value)}
    return tables, moved


def at_rest(name: str, value: Array) -> bool:
    """Whether a state is what a file has unless it says otherwise."""
    return tuple(value.tolist()) == REST[name.rpartition(".")[2]]


def whole_state(world: World, start: Mapping[str, Any]) -> State:
    """Position, orientation and velocities of every body, by name."""
    found = {
        f"{body.name}.{key}": np.array(floats(start.get(f"{body.name}.{key}", value)), float)
        for body in world.bodies
        for key, value in REST.items()
    }
    for name, value in found.items():
        if name.endswith(".orientation"):
            found[name] = value / max(float(np.linalg.norm(value)), 1e-12)
    return found


def placed_joint(world: World, joint: Joint, state: State) -> PlacedJoint:
    """A joint by the names of its bodies, with the coordinates that it has in a state as its start."""
    second = None if joint.second is None else world.bodies[joint.second].name
    still = PlacedJoint(joint.name, joint.kind, world.bodies[joint.first].name, second, joint.frames)
    placed, _ = placed_frames(still, state)
    count = len(joint.kind.coordinates)
    values = tuple(float(joint.value(k, placed, joint.start or (0.0,) * count)) for k in range(count))
    bent = any(abs(value) > ZERO_TOLERANCE for value in values)
    return PlacedJoint(
        still.name, still.kind, still.first, second, joint.frames, floats(joint.frequency), values if bent else ()
    )


def axes_at_zero(joint: PlacedJoint, zero: State, bent: bool) -> Array:
    """(3, 3): the axes of both frames as columns, world frame; SymphysError unless the frames coincide."""
    placed, _ = placed_frames(joint, zero)
    apart = float(np.linalg.norm(placed.apart))
    tilt = 0.0 if not joint.kind.turns else float(np.linalg.norm(placed.a - placed.b)) / np.sqrt(2)
    if not max(apart, tilt) <= MEETING_TOLERANCE:
        cause = "; where joints close a loop, a problem file needs all of their coordinates 0 at the start" * bent
        raise SymphysError(
            f"joint {joint.name!r}: its two sides are {apart:.4g} m and {tilt:.4g} rad from where it holds them at the "
            f"start; place its bodies so{cause}"
        )
    return np.asarray(placed.b)


def joint_table(world: World, joint: Joint, named: PlacedJoint, axes: Array) -> dict[str, Any]:
    """A joint, by its anchors and by its axes (3, 3) where its coordinates are 0."""
    table: dict[str, Any] = {
        "name": joint.name,
        "between": [named.second or "world", named.first],
        joint.kind.name: JOINTS[joint.kind.name].table(joint.kind, axes),
        "anchors": [floats(joint.frames[1].point), floats(joint.frames[0].point)],
        "collide": any({pair.first.body, pair.second.body} == set(joint.bodies) for pair in world.pairs),
        "frequency": named.frequency,
    }
    if table["frequency"]:
        table["damping"] = floats(joint.damping)
    if named.start:
        table["start"] = list(named.start)
    if joint.motor is not None:
        table["motor"] = {motor_kind(joint.motor): numbers(joint.motor)}
    if joint.spring is not None:
        table["spring"] = numbers(joint.spring)
    table |= {key: floats(value) for key in ("armature", "friction") if not is_zero(value := getattr(joint, key))}
    limits = (joint.limits.lower, joint.limits.upper)
    if limits != (None, None):
        table["limits"] = ends(limits)
    return table


def ends(limits: Sequence[Any]) -> list[float]:
    """[lower, upper]; infinite where there is none."""
    return [sign * np.inf if end is None else floats(end) for sign, end in zip((-1, 1), limits, strict=True)]
