"""Limits of what can be computed: masses and moments of inertia, memory, and the number of contact points.

Beyond the limits of masses and moments, inverses and products of masses leave the range of doubles. Memory is estimated
before anything of that size is made:

    bytes = 500 x 10^floor(log10 N) + 128 x N + 300 k + 40 w        x states, N steps, k numbers in variables, w weights

The first term is casadi's loop over the steps, which it lays out by powers of ten, the second what evaluations record;
both were measured with 1 to 8 bodies and 1,000 to a million steps (9.3 GB were used for a ball with as many knots), the
others with 300,000 numbers in knots and nets of 250,000 to 9 million weights. It may be off by a factor of two. What
solvers make beside it is not in it: the Jacobian of least squares is residuals x variables x 8 bytes, four times.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from math import floor, inf, log10
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from symphys.model.shapes import SHAPES, SURFACES, Convex, Plane, SolidShape, Sphere, Surface, Terrain, points_of_kinds
from symphys.model.shapes.inertia import specific
from symphys.model.state_layout import Layout
from symphys.model.world import World
from symphys.problem.model import Simulation, Variable
from symphys.problem.parametric.collision_filter import BodyClass, CollisionFilter, PairCount
from symphys.problem.parametric.parts import ParametricBody
from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.schema.physics import BodyTable

MASS_RANGE = (1e-100, 1e100)
"""[kg]"""
MOMENT_RANGE = (1e-140, 1e140)
"""[kg m^2], of the principal moments of inertia."""
BYTES_OF_LOOP, BYTES_OF_RECORD, BYTES_OF_NUMBER, BYTES_OF_WEIGHT = 500, 128, 300, 40
"""Bytes: of a state in a loop of steps; of a state and step; of a number in a variable; of a weight of a net."""
CGROUP_LIMITS = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"))
"""Where Linux states what a group of processes may use: version 2, version 1."""
GIB = 2.0**30
MAX_LISTED = 3
MAX_POINTS = 2000
"""Points of contact of a world: all are looked at in every step."""


def check_magnitudes(place: tuple[str, int], table: BodyTable, body: ParametricBody, faults: Faults) -> None:
    """Mass and inertia, given or following from density and shape, must be numbers that can be computed with."""
    if not within(body.mass, MASS_RANGE):
        key, origin = ("mass", "") if table.mass is not None else ("density", "the mass that follows from it ")
        faults.add((*place, key), f"{origin}must be {spelled(MASS_RANGE)} kg, not {body.mass:g}")
        return
    key, origin = ("inertia", "the principal moments ")
    if table.inertia is None:
        key, origin = ("shape", "the principal moments of the inertia that follows from it ")
    moments = principal(body)
    if not within(moments, MOMENT_RANGE):
        listed = ", ".join(f"{moment:g}" for moment in moments)
        faults.add((*place, key), f"{origin}must be {spelled(MOMENT_RANGE)} kg m^2, not {listed}")


def check_mass(where: Place, mass: float, faults: Faults) -> None:
    """A mass that a variable begins with."""
    if not within(mass, MASS_RANGE):
        faults.add(where, f"a mass must be {spelled(MASS_RANGE)} kg, not {mass:g}")


def principal(body: ParametricBody) -> NDArray[np.float64]:
    """(3,) [kg m^2]; not finite where the tensor is not."""
    own = body.inertia is not None
    tensor = np.asarray(body.inertia if own else specific(body.shapes), float)
    if tensor.ndim == 2 and np.isfinite(tensor).all():
        tensor = np.linalg.eigvalsh(tensor)
    elif tensor.ndim == 2:
        tensor = np.diagonal(tensor)
    with np.errstate(over="ignore", under="ignore"):
        return np.asarray(np.broadcast_to(tensor, 3) * (1.0 if own else body.mass))


def within(values: float | Sequence[float] | NDArray[np.float64], limits: tuple[float, float]) -> bool:
    """Whether all of them are; NaN is not."""
    given = np.asarray(values, float)
    return bool(np.all((given >= limits[0]) & (given <= limits[1])))


def spelled(limits: tuple[float, float]) -> str:
    """``from 1e-100 to 1e+100``."""
    return f"from {limits[0]:g} to {limits[1]:g}"


def available() -> float:
    """Bytes of the machine's memory, or what the processes of this group may use of it; inf where that is unknown."""
    try:
        found = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):  # not every system states it
        found = inf
    return min([found, *(limit(path) for path in CGROUP_LIMITS)])


def limit(path: Path) -> float:
    """The number in a file; inf where there is none."""
    try:
        return float(path.read_text())
    except (OSError, ValueError):
        return inf


def steps_need(states: int, steps: int) -> float:
    """Bytes for a rollout."""
    return BYTES_OF_LOOP * states * 10.0 ** floor(log10(max(steps, 1))) + BYTES_OF_RECORD * states * steps


def check_net(place: Place, weights: int, varied: bool, faults: Faults) -> bool:
    """Whether there is memory for a net; notes it if there is none. ``varied``: its weights are variables."""
    need, have = float(BYTES_OF_WEIGHT + BYTES_OF_NUMBER * varied) * weights, available()
    if need > have:
        text = f"a net of {weights} weights takes about {shown(need)} of memory, {shown(have)} can be used here"
        faults.add(place, f"{text}; take smaller layers")
    return need <= have


def check_rollout(world: World, simulation: Simulation, variables: Sequence[Variable], faults: Faults) -> None:
    """Notes steps and knots that there is no memory for."""
    states, have = Layout(world).size, available()
    need = steps_need(states, simulation.steps)
    if need > have:
        text = f"{simulation.steps} steps of {states} states take about {shown(need)} of memory, {shown(have)} can be"
        faults.add(("simulation", "dt"), f"{text} used here; take a larger dt or a shorter duration")
        return
    for index, variable in enumerate(variables):
        need += BYTES_OF_NUMBER * variable.guess.size
        if need > have:
            text = f"the steps, and all knots up to these, take about {shown(need)} of memory, {shown(have)} can be"
            faults.add(("variable", index, "knots"), f"{text} used here; take fewer")
            return


def shown(size: float) -> str:
    """``1.5 GiB``."""
    return f"{size / GIB:.3g} GiB"


MAX_CORNERS = 64
"""Corners of a hull that touches solids."""


def check_pair_limit(world: ParametricWorld, faults: Faults) -> None:
    """Check that a time step can compute all contact points, and that each has a rule."""
    candidates = CollisionFilter(world.parts, (*world.pairs, *world.jointed))
    counted = candidates.count(MAX_POINTS)
    if counted.points > MAX_POINTS:
        faults.stop(("body",), too_many(candidates, counted))
    if counted.uncovered:
        listed = ", ".join(f"{a} and {b}" for a, b in counted.uncovered[:MAX_LISTED])
        more = f" and {len(counted.uncovered) - MAX_LISTED} more" if len(counted.uncovered) > MAX_LISTED else ""
        faults.stop(
            ("body",),
            f"contact of such shapes is not known: {listed}{more}; let them pass through each other, by collides_with "
            "or by a [[pair]] with collide = false",
        )


def check_hulls(world: ParametricWorld, faults: Faults) -> None:
    """Check that hulls which touch solids have few corners: a step looks at all of them, a hundred times."""
    sizes = {
        part.name: max(
            (len(s.hull.corners) for s in part.surfaces if isinstance(s, Convex) and not s.flatness), default=0
        )
        for part in world.parts
    }
    if max(sizes.values(), default=0) <= MAX_CORNERS:
        return
    for pair in world.collision_pairs:
        for one, other in (pair, pair[::-1]):
            name, solid = world.parts[one].name, world.parts[other]
            met = [each.kind for each in solid.surfaces if not isinstance(each, Plane | Terrain | Sphere)]
            if sizes[name] > MAX_CORNERS and met:
                text = f"{name} has a hull of {sizes[name]} corners, and touches {solid.name}, a {met[0]}: hulls that "
                remedy = f"touch more than ground and spheres have at most {MAX_CORNERS}; give fewer points, or let "
                faults.stop(("body",), f"{text}{remedy}the two pass through each other, by collides_with or a [[pair]]")


def too_many(candidates: CollisionFilter, counted: PairCount) -> str:
    """Say how many contact points there are, where most come from, and what to do."""
    sets = list(candidates.sets.values())
    largest = counted.shares.most_common(MAX_LISTED)
    listed = ", ".join(f"{between(sets[a], sets[b], a == b)}: {count}" for (a, b), count in largest)
    count = f"{counted.points}" if counted.whole else f"more than {counted.points}"
    remedy = (
        "let fewer of them meet: give them a group, and say who touches whom by collides_with or by a [[pair]] with "
        "collide = false"
    )
    simplest = min(SHAPES.values(), key=most_points)
    solids = [solid for a, _ in counted.shares for solid in sets[a][0].part.surfaces if isinstance(solid, SolidShape)]
    others = sorted({solid.plural for solid in solids if most_points(type(solid)) > most_points(simplest)})
    if others:
        remedy += f"; or take {simplest.plural} in place of {' and '.join(others)}"
    return f"{count} points of contact in every step are too many, {MAX_POINTS} are allowed ({listed}); {remedy}"


def most_points(kind: type[Surface]) -> int:
    """Return the largest number of points in which a surface of this kind touches another."""
    return max(points_of_kinds(kind, other) for other in SURFACES.values())


def between(a: Sequence[BodyClass], b: Sequence[BodyClass], same: bool) -> str:
    """``40 boxes against each other``, ``40 boxes against ground``."""
    return f"{called(a)} against {'each other' if same else called(b)}"


def called(members: Sequence[BodyClass]) -> str:
    """A part by its name, several by their number and kind."""
    count, part = sum(len(each.members) for each in members), members[0].part
    if count == 1:
        return part.name
    if isinstance(part, ParametricBody):
        word = part.shapes[0].plural if len(part.shapes) == 1 else "compounds"
    else:
        word = part.static.plural
    return f"{count} {word} of {part.group}" if part.group else f"{count} {word}"
