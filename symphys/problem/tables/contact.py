"""Contact and pairs: who may touch whom, and under which law."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from symphys.model.world import Law, World, contradictions
from symphys.problem.parametric.parts import LAW, PairRule
from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.schema import Document
from symphys.problem.schema.physics import ContactTable, MemberTable, PairTable
from symphys.problem.tables.bodies import states
from symphys.suggest import hint, quote

MEMBERS = ("body", "plane", "block", "terrain")
"""Tables of bodies and static surfaces in lists."""
Statement = tuple[object, ...]
Rivals = dict[Statement, list[tuple[int, str]]]
"""[[pair]] tables by what they say: (index, the surface that it names)."""


def read_contact(table: ContactTable) -> Law:
    """The law where nothing else is stated."""
    return Law(**table.model_dump(exclude_none=True))


def read_pairs(
    tables: Sequence[PairTable], names: Sequence[str], groups: Sequence[str], faults: Faults
) -> tuple[PairRule, ...]:
    """The [[pair]] tables; notes names that do not exist and pairs that are stated twice."""
    pairs: list[PairRule] = []
    first: dict[frozenset[str], int] = {}
    for index, table in enumerate(tables):
        place = ("pair", index)
        a, b = table.between
        for name in dict.fromkeys(table.between):
            if name not in names and name not in groups:
                known = [*names, *groups]
                faults.add((*place, "between"), f"no surface or group is called {quote(name)}; {hint(name, known)}")
        between = frozenset((a, b))
        if a == b and a in names:
            faults.add((*place, "between"), "names the same surface twice")
        if first.setdefault(between, index) != index:
            other = faults.elsewhere(place, ("pair", first[between]))
            faults.add((*place, "between"), f"{a} and {b} already have a [[pair]] table{other}")
        own = states(table, LAW)
        if own and not table.collide:
            faults.add((*place, "collide"), f"with false, {', '.join(own)} would have no effect; leave one out")
        pairs.append(PairRule(f"{a}-{b}", between, table.collide, own))
    return tuple(pairs)


def check_collides_with(names: Sequence[str], groups: Sequence[str], document: Document, faults: Faults) -> None:
    """Check that names in collides_with are those of other bodies, static surfaces or groups."""
    tables: list[tuple[Place, MemberTable, str]] = [
        ((kind, index), table, table.name) for kind in MEMBERS for index, table in enumerate(getattr(document, kind))
    ]
    if document.ground is not None:
        tables.append((("ground",), document.ground, "ground"))
    known = {*names, *groups}
    for place, table, own in tables:
        for name in table.collides_with or ():
            if name not in known or name == own:
                others = [other for other in (*names, *groups) if other != own]
                message = f"no other body, no static surface and no group is called {quote(name)}; {hint(name, others)}"
                faults.add((*place, "collides_with"), message)


def check_ranks(parametric: ParametricWorld, faults: Faults) -> None:
    """Check that two [[pair]] tables of a surface and a group that hold for the same surfaces agree."""
    groups = {part.name: part.group for part in parametric.parts}
    found: dict[tuple[str | None, str | None], Rivals] = {}
    for index, pair in enumerate(parametric.pairs):
        own = {name for name in pair.between if name in groups}
        others = pair.between - own
        if len(own) == 1 and others:
            (name,), (group,) = own, others
            found.setdefault((group, groups[name]), {}).setdefault(statement(pair), []).append((index, name))
    for (shared, home), rivals in found.items():
        for index, name in (entry for entries in rivals.values() for entry in entries):
            rival = rival_of(parametric, index, name, found.get((home, shared), {}))
            if rival is not None and rival[0] < index:
                other, place = rival[1], ("pair", index)
                text = (
                    f"for {name} and {other}, this table and {faults.called(('pair', rival[0]), place)} say different "
                    "things; add a [[pair]] "
                    f'between = ["{name}", "{other}"], which goes before both'
                )
                faults.add((*place, "between"), text)


def statement(pair: PairRule) -> Statement:
    """Return the coefficients that a table states."""
    return (pair.collide, *sorted(pair.states.items()))


def rival_of(parametric: ParametricWorld, index: int, name: str, rivals: Rivals) -> tuple[int, str] | None:
    """The first of other tables, with its surface, that contradicts a table for the surface called ``name``."""
    bodies = {body.name for body in parametric.bodies}
    mine = statement(parametric.pairs[index])
    for place, other in (entry for said, entries in rivals.items() if said != mine for entry in entries):
        table = parametric.pair(name, other)
        settled = table is not None and table.between == {name, other}
        meet = bodies & {name, other} and parametric.lets(name, other) and parametric.lets(other, name)
        if other != name and meet and not settled:
            return place, other
    return None


def check_laws(parametric: ParametricWorld, nominal: World, faults: Faults) -> None:
    """A contact is either soft or has restitution; a [[pair]] table must belong to surfaces that may touch."""
    check_ranks(parametric, faults)
    used = set()
    for owners in dict.fromkeys(map(parametric.owners, nominal.pairs)):
        table = parametric.pair(*owners)
        used.add(table and table.name)
        stated = parametric.statements(*owners)
        for key, message in contradictions(owners, stated):
            faults.add((*table_place(parametric, stated[key][0][0], faults), key), message)
    for index, pair in enumerate(parametric.pairs):
        if pair.collide and pair.name not in used:
            faults.add(("pair", index, "between"), unused(parametric, pair))
    check_damping(parametric, faults)


def check_varied(
    parametric: ParametricWorld, nominal: World, varied: Iterable[tuple[Place, str]], faults: Faults
) -> None:
    """Variables and phases must not give restitution to soft contacts; ``varied``: names, and where they are."""
    soft = {name for pair in nominal.pairs if pair.law.soft for name in parametric.owners(pair)}
    soft |= {pair.name for pair in parametric.pairs if pair.states.get("frequency", parametric.contact.frequency)}
    owners = {parametric.owners(pair) for pair in nominal.pairs if pair.law.soft}
    soft |= {source[0] for both in owners for source in parametric.sources(*both)["restitution"]}
    for place, name in varied:
        owner, _, key = name.rpartition(".")
        if key == "restitution" and owner in soft:
            faults.add(place, f"{name} cannot vary: {owner} has soft contacts, which have no restitution")


def unused(parametric: ParametricWorld, pair: PairRule) -> str:
    """The message for a [[pair]] table that holds for no two surfaces."""
    if any(pair.between == jointed.between for jointed in parametric.jointed):
        return "a joint holds these two, which do not touch unless it says collide = true"
    if pair.between <= {part.name for part in parametric.parts}:
        return "these two never touch, so that nothing can be stated about them"
    return "no two of these ever touch, or tables that name them more closely go before this one: it has no effect"


def table_place(parametric: ParametricWorld, owner: str, faults: Faults) -> Place:
    """Return the place of the table that states a coefficient: of a surface, a pair or [contact]."""
    for kind in MEMBERS:
        for index, table in enumerate(faults.data.get(kind, ())):
            if table["name"] == owner:
                return kind, index
    pairs = [pair.name for pair in parametric.pairs]
    return ("pair", pairs.index(owner)) if owner in pairs else (owner,)


def check_damping(parametric: ParametricWorld, faults: Faults) -> None:
    """Damping without softness would have no effect."""
    stated = faults.data.get("contact", {})
    soft = parametric.contact.soft or any(pair.states.get("frequency") for pair in parametric.pairs)
    if "damping" in stated and not soft:
        faults.add(("contact", "damping"), "has no effect on rigid contacts; give frequency too")
    for index, pair in enumerate(parametric.pairs):
        if "damping" in pair.states and not pair.states.get("frequency", parametric.contact.frequency):
            faults.add(("pair", index, "damping"), "has no effect on a rigid contact; give frequency too")
