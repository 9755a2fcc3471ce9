"""Contacts that a world cannot have: of shapes without a rule, of surfaces that overlap at the start, and too many."""

from __future__ import annotations

from collections import Counter

from symphys.importing.tables.contact_tables import Meetings, Tables
from symphys.importing.tables.pose import at_start
from symphys.importing.tables.reading import ModelReading

POINTS = {
    "sphere": {"sphere": 1, "box": 1, "capsule": 1, "cylinder": 1, "ellipsoid": 1, "convex": 1},
    "box": {"box": 16, "capsule": 8},
    "capsule": {"capsule": 5, "cylinder": 3, "ellipsoid": 3},
    "plane": {"sphere": 1, "box": 8, "capsule": 2, "cylinder": 6, "ellipsoid": 1, "convex": 8},
}
"""In how many points two shapes may touch; terrain is like a plane. No others may."""
MOST_POINTS = 2000
"""Points of contact that a world may have."""
OVERLAP = 5e-4
"""[m]: deeper overlap at the start would be pushed out in the first steps."""


def points(one: str, other: str) -> int:
    """In how many points two kinds of surfaces may touch; 0: no rule covers them."""
    return POINTS.get(one, {}).get(other, 0) or POINTS.get(other, {}).get(one, 0)


def kinds_of(name: str, surfaces: Tables, still: Tables) -> Counter[str]:
    """How many shapes of each kind a surface has."""
    table = surfaces.get(name) or still[name]
    if "shape" not in table:
        return Counter(["plane"])
    parts = table["shape"].get("parts", [table["shape"]])
    return Counter(next(key for key in part if key not in ("centre", "orientation")) for part in parts)


def without_rule(reading: ModelReading, surfaces: Tables, still: Tables, meet: Meetings) -> Meetings:
    """Without those whose shapes cannot touch."""
    kinds = {name: kinds_of(name, surfaces, still) for name in (*surfaces, *still)}
    lost: Counter[str] = Counter()
    kept: Meetings = {}
    for names, law in meet.items():
        bare = {tuple(sorted((a, b))) for a in kinds[names[0]] for b in kinds[names[1]] if not points(a, b)}
        lost.update(" and ".join(pair) for pair in bare)
        if not bare:
            kept[names] = law
    if lost:
        which = ", ".join(f"{pair} ({count})" for pair, count in lost.most_common())
        text = f"there is no rule for contact between such shapes: {which}"
        reading.note("left out", f"contact of {len(meet) - len(kept)} pairs of surfaces", text)
    return kept


def without_overlap(reading: ModelReading, owners: dict[int, str], meet: Meetings) -> Meetings:
    """Without those that overlap at the start: a rigid world would push them apart."""
    if not meet:
        return meet
    deepest: dict[tuple[str, ...], float] = {}
    for contact in at_start(reading).contact:
        names = tuple(sorted({owners.get(contact.geom1, ""), owners.get(contact.geom2, "")}))
        if names in meet and contact.dist < -OVERLAP:
            deepest[names] = max(deepest.get(names, 0.0), -float(contact.dist))
    if deepest:
        listed = ", ".join(f"{' and '.join(names)} ({1e3 * depth:.3g} mm)" for names, depth in deepest.items())
        text = f"they overlap at the start, where a rigid world would push them apart: {listed}"
        amount = f"up to {1e3 * max(deepest.values()):.3g} mm"
        reading.note("left out", f"contact of {len(deepest)} pairs that overlap", text, amount)
    return {names: law for names, law in meet.items() if names not in deepest}


def few_enough(
    reading: ModelReading, owners: dict[int, str], surfaces: Tables, still: Tables, meet: Meetings
) -> Meetings:
    """At most as many points as a world may have: first without contact inside of trees, then between bodies at all."""
    kinds = {name: kinds_of(name, surfaces, still) for name in (*surfaces, *still)}
    counts = {names: pair_points(kinds[names[0]], kinds[names[1]]) for names in meet}
    total, model = sum(counts.values()), reading.model
    trees = {name: int(model.body_rootid[model.geom_bodyid[geom]]) for geom, name in owners.items()}
    inside = {names for names in meet if set(names) <= surfaces.keys() and trees[names[0]] == trees[names[1]]}
    bodies = {names for names in meet if set(names) <= surfaces.keys()}
    for lost, what in ((inside, "of one robot"), (bodies, "")):
        if total <= MOST_POINTS:
            break
        dropped = meet.keys() & lost
        text = f"there would be {total} points of contact, and a world may have {MOST_POINTS}"
        reading.note("left out", f"contact of {len(dropped)} pairs of bodies {what}".rstrip(), text)
        meet = {names: law for names, law in meet.items() if names not in dropped}
        total = sum(counts[names] for names in meet)
    among = sum(counts[names] for names in meet if names in bodies)
    if among:
        text = f"{among} of them are between bodies; self_collision = false leaves these out, and compiles faster"
        reading.note("taken", f"{total} points of contact", text)
    return meet


def pair_points(one: Counter[str], other: Counter[str]) -> int:
    """In how many points two surfaces may touch."""
    return sum(m * n * points(a, b) for a, m in one.items() for b, n in other.items())
