"""Who may touch whom, and with what friction: MuJoCo's filters and coefficients."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable
from itertools import combinations
from typing import Any

import numpy as np

from symphys.importing.tables.contact_limits import few_enough, without_overlap, without_rule
from symphys.importing.tables.contact_tables import KEYS, Law, Meetings, write_contacts
from symphys.importing.tables.reading import ModelReading, numbers
from symphys.importing.tables.shapes import Shapes
from symphys.model.world import mujoco_tangent
from symphys.types import Array


def read_contacts(
    reading: ModelReading, shapes: Shapes, bodies: list[dict[str, Any]], statics: dict[str, Any]
) -> dict[str, Any]:
    """[[pair]] tables; bodies and statics get ``friction``, and groups. "touching": two bodies that may touch."""
    owners = owners_of(reading, shapes)
    meet = {} if reading.off("CONTACT") else meetings(reading, owners)
    for table in bodies:
        if table["name"] in reading.seen:
            table["collides_with"] = []
    surfaces = {table["name"]: table for table in bodies if "shape" in table and table["name"] not in reading.seen}
    still = {table["name"]: table for key in ("plane", "block", "terrain") for table in statics.get(key, [])}
    if "ground" in statics:
        still["ground"] = statics["ground"]
    if reading.off("CONTACT"):
        pass_through(reading, surfaces)
        return {"touching": set()}
    if not reading.options.self_collision:
        apart = [names for names in meet if set(names) <= surfaces.keys()]
        meet = {names: law for names, law in meet.items() if names not in set(apart)}
        if apart:
            reading.note("left out", f"contact of {len(apart)} pairs of bodies of the robot", "as the caller chose")
    meet = without_overlap(reading, owners, without_rule(reading, surfaces, still, meet))
    meet = few_enough(reading, owners, surfaces, still, meet)
    pairs = write_contacts(reading, classes_of(reading, owners), surfaces, still, meet)
    directed = directed_pairs(reading, owners, meet)
    named = [set(table["between"]) for table in directed]
    pairs = [table for table in pairs if set(table["between"]) not in named] + directed
    soft(reading, owners)
    return {"pair": pairs, "touching": set(meet)}


def pass_through(reading: ModelReading, surfaces: dict[str, dict[str, Any]]) -> None:
    """Where the model switches contact off."""
    for table in surfaces.values():
        table["collides_with"] = []
    if surfaces:
        reading.note("taken", "contact", "the model's options switch it off: bodies touch nothing")


def classes_of(reading: ModelReading, owners: dict[int, str]) -> dict[str, Hashable]:
    """Of every surface what its contacts follow from: of each of its geoms the filters and coefficients."""
    model, found = reading.model, dict[str, set[tuple[object, ...]]]()
    for geom, name in owners.items():
        kind = model.geom_contype[geom], model.geom_conaffinity[geom], model.geom_condim[geom], model.geom_type[geom]
        coefficients = (model.geom_priority[geom], *model.geom_friction[geom].tolist())
        found.setdefault(name, set()).add((*(int(each) for each in kind), *coefficients))
    return {name: frozenset(kinds) for name, kinds in found.items()}


def owners_of(reading: ModelReading, shapes: Shapes) -> dict[int, str]:
    """The name of the body, or of what stands still, of every geom that was taken."""
    found = dict(reading.static_names)
    for top, parts in shapes.items():
        if reading.links[top].name in reading.seen:
            continue
        found |= {geom: reading.links[top].name for geom, _ in parts}
    return found


def meetings(reading: ModelReading, owners: dict[int, str]) -> Meetings:
    """Which surfaces may touch: by the types of their geoms, or because a pair says so."""
    model, found = reading.model, dict[tuple[str, str], list[Law]]()
    still = set(reading.static_names.values())
    named = zip(model.pair_geom1, model.pair_geom2, strict=True)
    explicit = {tuple(sorted((int(a), int(b)))): k for k, (a, b) in enumerate(named)}
    excluded = {(int(s) >> 16, int(s) & 0xFFFF) for s in model.exclude_signature}
    mixed = set[tuple[str, str]]()
    for one, other in combinations(sorted(owners), 2):
        a, b = owners[one], owners[other]
        names = (a, b) if a < b else (b, a)
        if a == b or {a, b} <= still:
            continue
        pair = explicit.get((one, other))
        if pair is not None:
            found.setdefault(names, []).append(pair_law(reading, pair))
        elif may_touch(reading, one, other, excluded):
            found.setdefault(names, []).append(geom_law(reading, one, other))
        else:
            mixed.add(names)
    partly = sorted(mixed & found.keys())
    several = sorted(names for names, each in found.items() if len(set(each)) > 1)
    if partly:
        text = "some of their surfaces may not touch in the model; here all of both may"
        reading.note("approximated", f"collision filter of {len(partly)} pairs of bodies", text)
    if several:
        text = "surfaces of one body have several laws in the model; here the largest friction holds for all"
        spread = max(max(law[0] for law in found[names]) - min(law[0] for law in found[names]) for names in several)
        reading.note("approximated", f"friction of {len(several)} pairs of bodies", text, f"{spread:g}")
    return {names: max(each) for names, each in found.items()}


def may_touch(reading: ModelReading, one: int, other: int, excluded: set[tuple[int, int]]) -> bool:
    """MuJoCo's rule: types, exclusions, and that a body does not touch what its joints hold it to."""
    model = reading.model
    types, affinities = model.geom_contype, model.geom_conaffinity
    if not (int(types[one]) & int(affinities[other]) or int(types[other]) & int(affinities[one])):
        return False
    a, b = int(model.geom_bodyid[one]), int(model.geom_bodyid[other])
    if (a, b) in excluded or (b, a) in excluded:
        return False
    a, b = int(model.body_weldid[a]), int(model.body_weldid[b])
    above = [int(model.body_weldid[int(model.body_parentid[body])]) for body in (a, b)]
    filtered = not int(model.opt.disableflags) & int(reading.library.mjtDisableBit.mjDSBL_FILTERPARENT)
    related = (a == above[1] and a != 0) or (b == above[0] and b != 0)
    return not (filtered and related)


def geom_law(reading: ModelReading, one: int, other: int) -> Law:
    """MuJoCo's mixing: of the geom with the higher priority, else the larger of each."""
    model = reading.model
    priorities = int(model.geom_priority[one]), int(model.geom_priority[other])
    chosen = [one, other] if priorities[0] == priorities[1] else [one if priorities[0] > priorities[1] else other]
    friction = np.max([model.geom_friction[geom] for geom in chosen], axis=0)
    directions = max(int(model.geom_condim[geom]) for geom in chosen)
    return law_of(friction[0], friction[1], friction[2], directions)


def pair_law(reading: ModelReading, pair: int) -> Law:
    """Of an explicit pair; of its coefficients along the two tangents of a contact the larger."""
    friction = reading.model.pair_friction[pair]
    return law_of(max(friction[:2]), friction[2], max(friction[3:5]), int(reading.model.pair_dim[pair]))


def directed_pairs(reading: ModelReading, owners: dict[int, str], meet: Meetings) -> list[dict[str, Any]]:
    """[[pair]] tables of what has two coefficients of friction; notes those whose directions turn with a body."""
    model, tables = reading.model, []
    geoms = Counter(owners.values())
    for pair, friction in enumerate(model.pair_friction):
        ends = int(model.pair_geom1[pair]), int(model.pair_geom2[pair])
        names = tuple(sorted(owners.get(geom, "") for geom in ends))
        if friction[0] == friction[1] or int(model.pair_dim[pair]) < 3 or names not in meet:
            continue
        direction = tangent_of(reading, *ends)
        if direction is None or any(geoms[name] > 1 for name in names):
            text = "friction along and across a direction that is not the same in all of their contacts; the larger "
            text += "coefficient holds in all directions: a [[pair]] may state another, with a friction_direction"
            reading.note("approximated", f"contact pair {pair}", text, f"{abs(friction[0] - friction[1]):g}")
            continue
        along_across = {"friction": numbers(friction[:2]), "friction_direction": numbers(direction)}
        lengths = {key: numbers(value) for key, value in zip(KEYS[1:], meet[names][1:], strict=True)}
        tables.append({"between": list(names), **along_across, **lengths})
    return tables


def tangent_of(reading: ModelReading, one: int, other: int) -> Array | None:
    """(3,): the first tangent of the contacts of two geoms; None where it turns with one of them."""
    kinds, types = reading.model.geom_type, reading.library.mjtGeom
    plane, body = (one, other) if kinds[one] == types.mjGEOM_PLANE else (other, one)
    if kinds[plane] != types.mjGEOM_PLANE or kinds[body] == types.mjGEOM_CAPSULE:
        return None
    return mujoco_tangent(np.array(reading.data.geom_xmat[plane]).reshape(3, 3)[:, 2])


def law_of(friction: float, torsion: float, rolling: float, directions: int) -> Law:
    """With what MuJoCo lets act in so many directions."""
    return (
        float(friction) if directions >= 3 else 0.0,
        float(torsion) if directions >= 4 else 0.0,
        float(rolling) if directions >= 6 else 0.0,
    )


def soft(reading: ModelReading, owners: dict[int, str]) -> None:
    """MuJoCo's contacts and limits are springs and dampers."""
    model = reading.model
    if owners:
        text = "contacts are rigid here, without solref, solimp, margin and gap"
        reading.note("approximated", f"softness of the contacts of {len(owners)} geoms", text)
    limited = int(np.sum(model.jnt_limited))
    if limited:
        reading.note("approximated", f"softness of {limited} limits", "limits of joints are rigid here")
