"""Sites of a model as [[site]] tables, and its loops as [[joint]] tables."""

from __future__ import annotations

from collections.abc import Container
from typing import Any

import numpy as np

from symphys.importing.tables.reading import ModelReading, is_upright, numbers, quaternion
from symphys.types import Array

MEET = 1e-6
"""[m], [rad]: how far apart the sides of a loop may be at the reference pose."""


def read_sites(reading: ModelReading) -> list[dict[str, Any]]:
    """Every site; one that is on a body which the world holds is the world's."""
    tables = []
    for site in range(reading.model.nsite):
        place, axes = np.array(reading.data.site_xpos[site]), np.array(reading.data.site_xmat[site]).reshape(3, 3)
        link = reading.links.get(int(reading.model.site_bodyid[site]))
        name = reading.names.give("site", reading.name("site", site), "site")
        reading.site_names[site] = name
        position = place if link is None else link.to_body(place)
        orientation = quaternion(axes) if link is None else link.turned(axes)
        table: dict[str, Any] = {"name": name, "body": "world" if link is None else link.name}
        table["position"] = numbers(position)
        tables.append(table if is_upright(orientation) else {**table, "orientation": orientation})
    return tables + welded_bodies(reading)


def welded_bodies(reading: ModelReading) -> list[dict[str, Any]]:
    """A site for every named body that is part of another, or of the world, where its frame is."""
    tables = []
    for body in range(1, reading.model.nbody):
        link, given = reading.links.get(body), reading.name("body", body)
        if not given or (link is not None and link.top == body):
            continue
        place, axes = np.array(reading.data.xpos[body]), np.array(reading.data.xmat[body]).reshape(3, 3)
        table: dict[str, Any] = {"name": reading.names.give("site", given, "site")}
        table["body"] = "world" if link is None else link.name
        table["position"] = numbers(place if link is None else link.to_body(place))
        orientation = quaternion(axes) if link is None else link.turned(axes)
        tables.append(table if is_upright(orientation) else {**table, "orientation": orientation})
    return tables


def read_loops(reading: ModelReading, touching: Container[tuple[str, ...]]) -> list[dict[str, Any]]:
    """[[joint]] tables that close loops, of the equality constraints but those of coordinates.

    Bodies that a loop holds together may touch as the model lets them: ``touching``, names in alphabetical order.
    """
    model, types = reading.model, reading.library.mjtEq
    joints = list[dict[str, Any]]()
    for equality in range(model.neq):
        kind, what = int(model.eq_type[equality]), reading.called("equality", equality)
        if not reading.holds(equality):
            reading.note("left out", what, "it is not active")
        elif kind in (int(types.mjEQ_CONNECT), int(types.mjEQ_WELD)):
            table = loop(reading, equality, kind == int(types.mjEQ_WELD))
            if table and tuple(sorted(table["between"])) in touching:
                table["collide"] = True
            joints += [table] if table else []
            reading.rigid += bool(table)
        elif kind != int(types.mjEQ_JOINT):
            reading.note("left out", what, "constraints of tendons and of flexible bodies have no counterpart")
    if reading.rigid:
        reading.note("approximated", f"softness of {reading.rigid} equality constraints", "they are rigid here")
    return joints


def loop(reading: ModelReading, equality: int, weld: bool) -> dict[str, Any] | None:
    """A joint that closes a loop: two points stay together, or two bodies."""
    what = reading.called("equality", equality)
    one, other, where, apart = sides(reading, equality, weld)
    names = [link.name if link else "world" for link in (reading.links.get(one), reading.links.get(other))]
    if names[0] == names[1]:
        reading.note("left out", what, "both of its bodies are one here")
        return None
    if max(apart) > MEET:
        text = "its two sides are apart at the reference pose, and joints here are closed from the start on"
        reading.note("left out", what, text, f"{1000 * apart[0]:.3g} mm, {apart[1]:.3g} rad")
        return None
    name = reading.names.give("joint", reading.name("equality", equality), "loop")
    ends = names if names[1] != "world" else names[::-1]
    table: dict[str, Any] = {"name": name, "between": ends, "fixed" if weld else "ball": {}}
    return {**table, "point": numbers(where)}


def sides(reading: ModelReading, equality: int, weld: bool) -> tuple[int, int, Array, tuple[float, float]]:
    """The two bodies, where they meet (3,) [m], and how far their sides are apart [m], [rad]."""
    model, data = reading.model, reading.data
    ids = int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])
    if int(model.eq_objtype[equality]) == int(reading.library.mjtObj.mjOBJ_SITE):
        points = [np.array(data.site_xpos[k]) for k in ids]
        axes = [np.array(data.site_xmat[k]).reshape(3, 3) for k in ids]
        bodies = tuple(int(model.site_bodyid[k]) for k in ids)
        tilt = angle(axes[0].T @ axes[1]) if weld else 0.0
        return bodies[0], bodies[1], points[0], (float(np.linalg.norm(points[0] - points[1])), tilt)
    numbers_of, places = np.array(model.eq_data[equality]), [np.array(data.xpos[k]) for k in ids]
    axes = [np.array(data.xmat[k]).reshape(3, 3) for k in ids]
    if not weld:
        points = [places[k] + axes[k] @ numbers_of[3 * k : 3 * k + 3] for k in (0, 1)]
        return ids[0], ids[1], points[0], (float(np.linalg.norm(points[0] - points[1])), 0.0)
    # of a weld: an anchor on the second, where the first is from there, and how it is turned
    anchor, place, turn = numbers_of[:3], numbers_of[3:6], numbers_of[6:10]
    turned = np.zeros(9)
    reading.library.mju_quat2Mat(turned, turn)
    where = places[1] + axes[1] @ anchor
    gap = float(np.linalg.norm(where - (places[0] + axes[0] @ place)))
    return ids[0], ids[1], where, (gap, angle((axes[0] @ turned.reshape(3, 3)).T @ axes[1]))


def angle(axes: Any) -> float:
    """Of a rotation matrix [rad]."""
    return float(np.arccos(np.clip((np.trace(axes) - 1) / 2, -1, 1)))
