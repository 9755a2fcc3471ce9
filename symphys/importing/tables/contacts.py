"""Contacts of a model: which surfaces may touch and with what friction, as few [[pair]] tables.

MuJoCo has filters and coefficients for each pair of geoms. Contacts that a world cannot have are left out: shapes
without a rule, overlap at the start, too many points. Bodies state their friction and static surfaces none, so that the
body's holds. Two bodies would multiply theirs; a [[pair]] table gives what they have in the model instead.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from itertools import combinations, combinations_with_replacement, product
from typing import Any

import numpy as np

from symphys.importing.tables.pose import at_start
from symphys.importing.tables.reading import ModelReading, numbers
from symphys.importing.tables.shapes import Shapes
from symphys.model.shapes import SURFACES, points_of_kinds
from symphys.model.world import COMBINE, mujoco_tangent
from symphys.types import Array

Law = tuple[float, float, float]
"""Friction, torsion [m], rolling [m]."""
KEYS = ("friction", "torsion", "rolling")
PairLaws = dict[tuple[str, str], Law]
"""The law of every two surfaces that may touch, by their names in alphabetical order."""
Tables = Mapping[str, dict[str, Any]]
"""Tables of surfaces by their names."""
Statement = tuple[tuple[str, Any], ...]
"""The keys of a [[pair]] table; empty where none is needed."""
NO_CONTACT: Statement = (("collide", False),)
MAX_POINTS = 2000
"""Points of contact that a world may have."""
MAX_OWN_CORNERS = 200
"""Corners of hulls, pair by pair, that meet other parts of their own robot: a gripper's fingers have few."""
MAX_START_OVERLAP = 5e-4
"""[m] Overlap at the start beyond which contact is left out, since it would be pushed out in the first steps."""


def read_contacts(
    reading: ModelReading, shapes: Shapes, bodies: list[dict[str, Any]], statics: dict[str, Any]
) -> dict[str, Any]:
    """Return [[pair]] tables, and as "touching" the bodies that may touch; surfaces get ``friction`` and groups."""
    owners = owners_of(reading, shapes)
    meet = {} if reading.off("CONTACT") else touching_pairs(reading, owners)
    for table in bodies:
        if table["name"] in reading.seen:
            table["collides_with"] = []
    surfaces = {table["name"]: table for table in bodies if "shape" in table and table["name"] not in reading.seen}
    still = {table["name"]: table for key in ("plane", "block", "terrain") for table in statics.get(key, [])}
    if "ground" in statics:
        still["ground"] = statics["ground"]
    if reading.off("CONTACT"):
        for table in surfaces.values():
            table["collides_with"] = []
        if surfaces:
            reading.note("taken", "contact", "the model's options switch it off: bodies touch nothing")
        return {"touching": set()}
    if not reading.options.self_collision:
        apart = [names for names in meet if set(names) <= surfaces.keys()]
        meet = {names: law for names, law in meet.items() if names not in set(apart)}
        if apart:
            reading.note("left out", f"contact of {len(apart)} pairs of bodies of the robot", "as the caller chose")
    kinds = {name: kinds_of(table) for name, table in {**still, **surfaces}.items()}
    meet = without_overlap(reading, owners, without_rule(reading, kinds, meet))
    meet = few_enough(reading, owners, surfaces, kinds, few_hulls(reading, owners, surfaces, meet))
    pairs = write_contacts(reading, classes_of(reading, owners), surfaces, still, meet)
    directed = directed_pairs(reading, owners, meet)
    named = [set(table["between"]) for table in directed]
    pairs = [table for table in pairs if set(table["between"]) not in named] + directed
    soft(reading, owners)
    return {"pair": pairs, "touching": set(meet)}


def owners_of(reading: ModelReading, shapes: Shapes) -> dict[int, str]:
    """Return the name of the body or static surface of every geom that was taken."""
    found = dict(reading.static_names)
    for top, parts in shapes.items():
        if reading.links[top].name in reading.seen:
            continue
        found |= {geom: reading.links[top].name for geom, _ in parts}
    return found


def classes_of(reading: ModelReading, owners: dict[int, str]) -> dict[str, Hashable]:
    """Return the class of every surface, on which its contacts depend: filters and coefficients of its geoms."""
    model, found = reading.model, dict[str, set[tuple[object, ...]]]()
    for geom, name in owners.items():
        kind = model.geom_contype[geom], model.geom_conaffinity[geom], model.geom_condim[geom], model.geom_type[geom]
        coefficients = (model.geom_priority[geom], *model.geom_friction[geom].tolist())
        found.setdefault(name, set()).add((*(int(each) for each in kind), *coefficients))
    return {name: frozenset(kinds) for name, kinds in found.items()}


def touching_pairs(reading: ModelReading, owners: dict[int, str]) -> PairLaws:
    """Return the pairs of surfaces that may touch: by the types of their geoms, or by an explicit pair."""
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
    """Apply MuJoCo's rule: types, exclusions, and that a body does not touch the one its joints hold it to."""
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
    """Mix coefficients as MuJoCo does: of the geom with the higher priority, else the larger of each."""
    model = reading.model
    priorities = int(model.geom_priority[one]), int(model.geom_priority[other])
    chosen = [one, other] if priorities[0] == priorities[1] else [one if priorities[0] > priorities[1] else other]
    friction = np.max([model.geom_friction[geom] for geom in chosen], axis=0)
    directions = max(int(model.geom_condim[geom]) for geom in chosen)
    return law_of(friction[0], friction[1], friction[2], directions)


def pair_law(reading: ModelReading, pair: int) -> Law:
    """Return the law of an explicit pair, with the larger of its coefficients along the two tangents."""
    friction = reading.model.pair_friction[pair]
    return law_of(max(friction[:2]), friction[2], max(friction[3:5]), int(reading.model.pair_dim[pair]))


def directed_pairs(reading: ModelReading, owners: dict[int, str], meet: PairLaws) -> list[dict[str, Any]]:
    """Return [[pair]] tables with two coefficients of friction; note pairs whose directions turn with a body."""
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
    """Return the first tangent (3,) of the contacts of two geoms; None if it turns with one of them."""
    kinds, types = reading.model.geom_type, reading.library.mjtGeom
    plane, body = (one, other) if kinds[one] == types.mjGEOM_PLANE else (other, one)
    if kinds[plane] != types.mjGEOM_PLANE or kinds[body] == types.mjGEOM_CAPSULE:
        return None
    return mujoco_tangent(np.array(reading.data.geom_xmat[plane]).reshape(3, 3)[:, 2])


def law_of(friction: float, torsion: float, rolling: float, directions: int) -> Law:
    """Keep the coefficients that act in a contact of MuJoCo with so many ``directions``."""
    return (
        float(friction) if directions >= 3 else 0.0,
        float(torsion) if directions >= 4 else 0.0,
        float(rolling) if directions >= 6 else 0.0,
    )


def without_overlap(reading: ModelReading, owners: dict[int, str], meet: PairLaws) -> PairLaws:
    """Drop pairs that overlap at the start, which a rigid world would push apart."""
    if not meet:
        return meet
    deepest: dict[tuple[str, ...], float] = {}
    for contact in at_start(reading).contact:
        names = tuple(sorted({owners.get(contact.geom1, ""), owners.get(contact.geom2, "")}))
        if names in meet and contact.dist < -MAX_START_OVERLAP:
            deepest[names] = max(deepest.get(names, 0.0), -float(contact.dist))
    if deepest:
        listed = ", ".join(f"{' and '.join(names)} ({1e3 * depth:.3g} mm)" for names, depth in deepest.items())
        text = f"they overlap at the start, where a rigid world would push them apart: {listed}"
        amount = f"up to {1e3 * max(deepest.values()):.3g} mm"
        reading.note("left out", f"contact of {len(deepest)} pairs that overlap", text, amount)
    return {names: law for names, law in meet.items() if names not in deepest}


def without_rule(reading: ModelReading, kinds: Mapping[str, Counter[str]], meet: PairLaws) -> PairLaws:
    """Drop pairs of surfaces whose shapes cannot touch; ``kinds``: how many shapes of each kind a surface has."""
    lost: Counter[str] = Counter()
    kept: PairLaws = {}
    for names, law in meet.items():
        bare = {tuple(sorted((a, b))) for a in kinds[names[0]] for b in kinds[names[1]] if not contact_points(a, b)}
        lost.update(" and ".join(pair) for pair in bare)
        if not bare:
            kept[names] = law
    if lost:
        which = ", ".join(f"{pair} ({count})" for pair, count in lost.most_common())
        text = f"there is no rule for contact between such shapes: {which}"
        reading.note("left out", f"contact of {len(meet) - len(kept)} pairs of surfaces", text)
    return kept


def kinds_of(table: Mapping[str, Any]) -> Counter[str]:
    """Return how many shapes of each kind a surface has."""
    if "shape" not in table:
        return Counter(["plane"])
    parts = table["shape"].get("parts", [table["shape"]])
    return Counter(next(key for key in part if key not in ("centre", "orientation")) for part in parts)


def contact_points(one: str, other: str) -> int:
    """Return the number of contact points of two kinds of surfaces; 0: no rule covers them."""
    return points_of_kinds(SURFACES[one], SURFACES[other])


def few_hulls(reading: ModelReading, owners: dict[int, str], surfaces: Tables, meet: PairLaws) -> PairLaws:
    """Drop contact of hulls with other parts of their own robot, if they have many corners together.

    A step looks at every corner some hundred times, and a robot of meshes has tens of such pairs, of which few meet.
    """
    corners = {name: hull_corners(table) for name, table in surfaces.items()}
    trees = {name: int(reading.model.body_rootid[reading.model.geom_bodyid[geom]]) for geom, name in owners.items()}
    costs = {
        names: sum(corners[name] for name in names)
        for names in meet
        if set(names) <= surfaces.keys() and trees[names[0]] == trees[names[1]]
    }
    hulls, total = {names for names, cost in costs.items() if cost}, sum(costs.values())
    if total <= MAX_OWN_CORNERS:
        return meet
    text = f"their hulls have {total} corners, pair by pair, and those of a robot may have {MAX_OWN_CORNERS}"
    reading.note("left out", f"contact of {len(hulls)} pairs of bodies of one robot", f"{text}; fit simpler shapes")
    return {names: law for names, law in meet.items() if names not in hulls}


def hull_corners(table: Mapping[str, Any]) -> int:
    """Return how many points the hulls of a surface have."""
    parts = table["shape"].get("parts", [table["shape"]]) if "shape" in table else []
    return sum(len(part["convex"]["points"]) for part in parts if "convex" in part)


def few_enough(
    reading: ModelReading, owners: dict[int, str], surfaces: Tables, kinds: Mapping[str, Counter[str]], meet: PairLaws
) -> PairLaws:
    """Limit the points of contact: drop contact within robots first, then between bodies at all."""
    counts = {
        names: sum(m * n * contact_points(a, b) for a, m in kinds[names[0]].items() for b, n in kinds[names[1]].items())
        for names in meet
    }
    total, model = sum(counts.values()), reading.model
    trees = {name: int(model.body_rootid[model.geom_bodyid[geom]]) for geom, name in owners.items()}
    inside = {names for names in meet if set(names) <= surfaces.keys() and trees[names[0]] == trees[names[1]]}
    bodies = {names for names in meet if set(names) <= surfaces.keys()}
    for lost, what in ((inside, "of one robot"), (bodies, "")):
        if total <= MAX_POINTS:
            break
        dropped = meet.keys() & lost
        text = f"there would be {total} points of contact, and a world may have {MAX_POINTS}"
        reading.note("left out", f"contact of {len(dropped)} pairs of bodies {what}".rstrip(), text)
        meet = {names: law for names, law in meet.items() if names not in dropped}
        total = sum(counts[names] for names in meet)
    among = sum(counts[names] for names in meet if names in bodies)
    if among:
        text = f"{among} of them are between bodies; self_collision = false leaves these out, and compiles faster"
        reading.note("taken", f"{total} points of contact", text)
    return meet


def write_contacts(
    reading: ModelReading, classes: Mapping[str, Hashable], surfaces: Tables, still: Tables, meet: PairLaws
) -> list[dict[str, Any]]:
    """Return the [[pair]] tables; surfaces get their friction and groups.

    Args:
        reading: gives groups their names, and knows which bodies joints hold together.
        classes: of each surface what its contacts follow from.
        surfaces: tables of bodies with shapes.
        still: tables of what stands still.
        meet: pairs of surfaces that may touch.
    """
    own = {name: own_law(name, still, meet) for name in surfaces}
    for name, law in own.items():
        surfaces[name].update(
            {key: numbers(value) for key, value in zip(KEYS, law, strict=True) if value or key == KEYS[0]}
        )
    members: dict[Hashable, list[str]] = {}
    for name in (*surfaces, *still):
        members.setdefault((classes.get(name), own.get(name)), []).append(name)
    jointed = {tuple(sorted(pair)) for pair in reading.jointed}
    pairs: list[dict[str, Any]] = []
    groups: dict[str, str] = {}
    for one, other in combinations_with_replacement(list(members.values()), 2):
        both = combinations(one, 2) if one is other else product(one, other)
        names = [tuple(sorted(pair)) for pair in both if set(pair) & surfaces.keys()]
        wanted = {(a, b): statement((a, b), own, meet) for a, b in names if (a, b) not in jointed or (a, b) in meet}
        pairs += class_tables(reading, wanted, one, other, groups)
    for name, group in groups.items():
        (surfaces.get(name) or still[name])["group"] = group
    return pairs


def own_law(name: str, still: Tables, meet: PairLaws) -> Law:
    """Return the friction of a body: with static surfaces, or with other bodies if it meets no static one."""
    found = {other: law for pair, law in meet.items() if name in pair for other in pair if other != name}
    laws = Counter(law for other, law in found.items() if other in still) or Counter(found.values())
    return laws.most_common(1)[0][0] if laws else (1.0, 0.0, 0.0)


def statement(names: tuple[str, str], own: Mapping[str, Law], meet: PairLaws) -> Statement:
    """Return the keys of a [[pair]] table that two surfaces need besides their own friction."""
    law = meet.get(names)
    if law is None:
        return NO_CONTACT
    stated = list(zip(KEYS, zip(*(own[name] for name in names if name in own), strict=True), strict=True))
    follows = [each[0] if len(each) == 1 else COMBINE[key](list(each)) for key, each in stated]
    off = [key for key, x, y in zip(KEYS, law, follows, strict=True) if abs(x - y) > 1e-12]
    return tuple((key, numbers(value)) for key, value in zip(KEYS, law, strict=True) if key in off)


def class_tables(
    reading: ModelReading,
    wanted: Mapping[tuple[str, str], Statement],
    one: Sequence[str],
    other: Sequence[str],
    groups: dict[str, str],
) -> list[dict[str, Any]]:
    """Return one table for two classes if most of their pairs need the same, and one for each pair that differs."""
    if not wanted:
        return []
    most, count = Counter(wanted.values()).most_common(1)[0]
    together = bool(most) and count > 1
    usual = most if together else ()
    tables = []
    if together:
        ends = [class_name(reading, members, groups) for members in (one, other)]
        tables.append({"between": ends, **dict(most)})
    for names, needed in wanted.items():
        if needed != usual:
            tables.append({"between": list(names), **dict(needed)})
    return tables


def class_name(reading: ModelReading, members: Sequence[str], groups: dict[str, str]) -> str:
    """Return the name of a class: of its only member, or of a group that is named after its first."""
    if len(members) == 1:
        return members[0]
    if members[0] not in groups:
        name = reading.names.give("group", f"{members[0]}_group")
        groups.update(dict.fromkeys(members, name))
    return groups[members[0]]


def soft(reading: ModelReading, owners: dict[int, str]) -> None:
    """Note that MuJoCo's contacts and limits are springs and dampers."""
    model = reading.model
    if owners:
        text = "contacts are rigid here, without solref, solimp, margin and gap"
        reading.note("approximated", f"softness of the contacts of {len(owners)} geoms", text)
    limited = int(np.sum(model.jnt_limited))
    if limited:
        reading.note("approximated", f"softness of {limited} limits", "limits of joints are rigid here")
