"""Bodies of a model, welded where no joint lies between them, as the [[body]] tables of a problem file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from symphys.importing.records import Inertial
from symphys.importing.tables.reading import FREE, ModelReading, WeldedLink, is_upright, numbers, quaternion
from symphys.types import Array

MIN_MASS_SHARE, MASSLESS_RADIUS = 1e-6, 0.1
"""For a floating body without mass: its share of the model's mass, and its radius of gyration [m]."""
MIN_MOMENT = 1e-6
"""Least moment of inertia, as a share of the largest."""
INERTIA_TOLERANCE = 1e-9
"""Tolerance of the inequality of moments of inertia, as a share of the largest."""
PRODUCT_ROUNDING = 1e-12
"""Product of inertia that counts as rounding, as a share of the largest moment."""


def read_links(reading: ModelReading, inertials: Mapping[str, Inertial]) -> None:
    """Read every body that moves, with the bodies that are welded to it."""
    model = reading.model
    members: dict[int, list[int]] = {}
    for body in range(1, model.nbody):
        top = int(model.body_weldid[body])
        mocap = top and not model.body_jntnum[top]  # moved by its user alone
        members.setdefault(0 if mocap else top, []).append(body)
    weld_empty_ends(reading, members, inertials)
    held = members.pop(0, [])
    for top, bodies in sorted(members.items()):
        link = merged(reading, top, bodies, inertials)
        reading.links |= dict.fromkeys(bodies, link)
        if len(bodies) > 1:
            others = ", ".join(reading.name("body", body) or str(body) for body in bodies if body != top)
            reading.note("taken", f"body {link.name}", f"with what no joint lets move against it: {others}")
    moving = [reading.called("body", body) for body in held if model.body_mocapid[body] >= 0]
    if moving:
        reading.note("left out", "motion of " + ", ".join(moving), "mocap bodies stand still where they are")


def weld_empty_ends(reading: ModelReading, members: dict[int, list[int]], inertials: Mapping[str, Inertial]) -> None:
    """Weld massless bodies at the ends of branches, which have nothing to move, to their parents."""
    model, welded = reading.model, []
    parents = {top: int(model.body_weldid[model.body_parentid[top]]) for top in members if top}
    for top in sorted(parents, reverse=True):
        joints = [model.jnt_type[joint] for joint in reading.joints_of(top)]
        weighs = any(part(reading, body, inertials)[0] > 0 for body in members[top])
        if weighs or top in parents.values() or FREE in joints:
            continue
        members.setdefault(parents.pop(top), []).extend(members.pop(top))
        welded.append(reading.called("body", top))
    if welded:
        text = "bodies without mass at the end of a branch have nothing to move, so they are welded to it"
        reading.note("left out", f"joints of {', '.join(reversed(welded))}", text)


def merged(reading: ModelReading, top: int, bodies: list[int], inertials: Mapping[str, Inertial]) -> WeldedLink:
    """Merge welded bodies into one."""
    parts = [part(reading, body, inertials) for body in bodies]
    mass = sum(each[0] for each in parts)
    axes = np.array(reading.data.xmat[top]).reshape(3, 3)
    name = reading.names.give("body", reading.name("body", top), "body")
    place = np.array(reading.data.xpos[top])
    if mass <= 0 and not any(reading.model.jnt_type[joint] == FREE for joint in reading.joints_of(top)):
        return WeldedLink(top, tuple(bodies), name, 0.0, place, axes, np.zeros((3, 3)))
    if mass <= 0:
        mass = MIN_MASS_SHARE * float(reading.model.body_subtreemass[0] or 1.0)
        text = "it floats, and has no mass in the model; it gets a small one"
        reading.note("approximated", f"mass of {name}", text, f"{mass:.3g} kg")
        return WeldedLink(top, tuple(bodies), name, mass, place, axes, mass * MASSLESS_RADIUS**2 * np.eye(3))
    centre = sum((m * c for m, c, _ in parts), start=np.zeros(3)) / mass
    total = np.zeros((3, 3))
    for m, c, inertia in parts:
        arm = c - centre
        total += inertia + m * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return WeldedLink(
        top, tuple(bodies), name, mass, centre, axes, possible(reading, name, mass, axes.T @ total @ axes)
    )


def possible(reading: ModelReading, name: str, mass: float, tensor: Array) -> Array:
    """Return an inertia (3, 3) that a rigid body can have; a repair is noted.

    Moments that are too small grow to a share of the largest, and one above the sum of the others falls to that.
    """
    tensor = (tensor + tensor.T) / 2
    moments, axes = np.linalg.eigh(tensor)
    mended = np.maximum(moments, MIN_MOMENT * max(float(moments[2]), MIN_MOMENT * mass))
    mended[2] = min(mended[2], mended[0] + mended[1])
    off = float(np.abs(mended - moments).max())
    if off <= INERTIA_TOLERANCE * float(moments[2]):
        return np.asarray(tensor)
    text = "no rigid body has the moments of the model; these are the nearest that are possible"
    reading.note("approximated", f"inertia of {name}", text, f"{off:.3g} kg m^2")
    return np.asarray(axes @ np.diag(mended) @ axes.T)


def part(reading: ModelReading, body: int, inertials: Mapping[str, Inertial]) -> tuple[float, Array, Array]:
    """Return mass, centre of mass and inertia about it of one body of the model, world frame."""
    own = inertials.get(reading.name("body", body))
    if own is not None:
        axes = np.array(reading.data.xmat[body]).reshape(3, 3)
        centre = np.array(reading.data.xpos[body]) + axes @ np.asarray(own.centre)
        return own.mass, centre, axes @ np.asarray(own.inertia) @ axes.T
    axes = np.array(reading.data.ximat[body]).reshape(3, 3)
    moments = np.diag(reading.model.body_inertia[body])
    return float(reading.model.body_mass[body]), np.array(reading.data.xipos[body]), axes @ moments @ axes.T


def body_table(link: WeldedLink, shapes: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the [[body]] table of a link."""
    table: dict[str, Any] = {"name": link.name, "mass": numbers(link.mass)}
    if link.mass:
        table["inertia"] = inertia_of(link.inertia)
    table["position"] = numbers(link.centre)
    orientation = quaternion(link.axes)
    if link.mass and not is_upright(orientation):
        table["orientation"] = orientation
    if shapes:
        alone = len(shapes) == 1 and not ({"centre", "orientation"} & shapes[0].keys())
        table["shape"] = shapes[0] if alone else {"parts": shapes}
    return table


def inertia_of(tensor: Array) -> Any:
    """Return three principal moments if they are along the axes, else the matrix."""
    tensor = (tensor + tensor.T) / 2
    moments = np.diag(tensor)
    if np.abs(tensor - np.diag(moments)).max() <= PRODUCT_ROUNDING * moments.max():
        return numbers(moments, 0.0)
    return numbers(tensor, 0.0)


def frame_table(name: str, place: Array) -> dict[str, Any]:
    """Return the [[body]] table of a frame between two joints."""
    return {"name": name, "mass": 0, "position": numbers(place)}
