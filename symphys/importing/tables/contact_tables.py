"""Contacts as few [[pair]] tables: what holds for all surfaces of a kind is said of groups.

Bodies state their friction, and what stands still states none: then that of the body holds. Two bodies would multiply
theirs; a [[pair]] table says what they have in the model instead.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from itertools import combinations, combinations_with_replacement, product
from typing import Any

from symphys.importing.tables.reading import ModelReading, numbers
from symphys.model.world import COMBINE

Law = tuple[float, float, float]
"""Friction, torsion [m], rolling [m]."""
KEYS = ("friction", "torsion", "rolling")
Meetings = dict[tuple[str, str], Law]
"""The law of every two surfaces that may touch, by their names in alphabetical order."""
Tables = Mapping[str, dict[str, Any]]
"""Of surfaces by their names."""
Statement = tuple[tuple[str, Any], ...]
"""What a [[pair]] table says; empty where none is needed."""
APART: Statement = (("collide", False),)


def write_contacts(
    reading: ModelReading, classes: Mapping[str, Hashable], surfaces: Tables, still: Tables, meet: Meetings
) -> list[dict[str, Any]]:
    """The [[pair]] tables; surfaces get their friction and groups.

    Args:
        reading: gives groups their names, and knows which bodies joints hold together.
        classes: of each surface what its contacts follow from.
        surfaces: tables of bodies with shapes.
        still: tables of what stands still.
        meet: who may touch whom.
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
        pairs += said(reading, wanted, one, other, groups)
    for name, group in groups.items():
        (surfaces.get(name) or still[name])["group"] = group
    return pairs


def own_law(name: str, still: Tables, meet: Meetings) -> Law:
    """What a body brings into contact with what stands still; with other bodies, where it meets nothing else."""
    found = {other: law for pair, law in meet.items() if name in pair for other in pair if other != name}
    laws = Counter(law for other, law in found.items() if other in still) or Counter(found.values())
    return laws.most_common(1)[0][0] if laws else (1.0, 0.0, 0.0)


def statement(names: tuple[str, str], own: Mapping[str, Law], meet: Meetings) -> Statement:
    """What must be said of two surfaces, beside what they state."""
    law = meet.get(names)
    if law is None:
        return APART
    stated = list(zip(KEYS, zip(*(own[name] for name in names if name in own), strict=True), strict=True))
    follows = [each[0] if len(each) == 1 else COMBINE[key](list(each)) for key, each in stated]
    off = [key for key, x, y in zip(KEYS, law, follows, strict=True) if abs(x - y) > 1e-12]
    return tuple((key, numbers(value)) for key, value in zip(KEYS, law, strict=True) if key in off)


def said(
    reading: ModelReading,
    wanted: Mapping[tuple[str, str], Statement],
    one: Sequence[str],
    other: Sequence[str],
    groups: dict[str, str],
) -> list[dict[str, Any]]:
    """A table for two classes where most of them need the same, and one for each two that need something else."""
    if not wanted:
        return []
    most, count = Counter(wanted.values()).most_common(1)[0]
    together = bool(most) and count > 1
    usual = most if together else ()
    tables = []
    if together:
        ends = [called(reading, members, groups) for members in (one, other)]
        tables.append({"between": ends, **dict(most)})
    for names, needed in wanted.items():
        if needed != usual:
            tables.append({"between": list(names), **dict(needed)})
    return tables


def called(reading: ModelReading, members: Sequence[str], groups: dict[str, str]) -> str:
    """The name of a class: of its only member, or of a group, which its first member gives its name."""
    if len(members) == 1:
        return members[0]
    if members[0] not in groups:
        name = reading.names.give("group", f"{members[0]}_group")
        groups.update(dict.fromkeys(members, name))
    return groups[members[0]]
