"""Planes, contact and pairs: who may touch whom, and under which law."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np

from symphys.problem.bodies import states
from symphys.problem.faults import Faults, Place
from symphys.problem.model import Variable
from symphys.problem.plan import BodyPlan, PairPlan, PlanePlan, WorldPlan
from symphys.problem.schema import Document
from symphys.problem.schema.physics import ContactTable, GroundTable, PairTable, PlaneTable
from symphys.suggest import hint, quote
from symphys.world import Law

MAX_PAIRS = 100_000


def read_planes(document: Document, faults: Faults) -> tuple[PlanePlan, ...]:
    """The ground, if there is one, then the planes."""
    ground = () if document.ground is None else (read_ground(document.ground),)
    return ground + tuple(read_plane(i, table, faults) for i, table in enumerate(document.plane))


def read_ground(table: GroundTable) -> PlanePlan:
    """The horizontal plane called ground."""
    return PlanePlan("ground", (0.0, 0.0, 1.0), table.height, states(table))


def read_plane(index: int, table: PlaneTable, faults: Faults) -> PlanePlan:
    """One plane."""
    place = ("plane", index)
    length = float(np.linalg.norm(table.normal))
    if not (isfinite(length) and length > 1e-12):
        faults.add((*place, "normal"), "must not be zero; [0, 0, 1] points up")
        length = 1.0
    normal = np.array(table.normal) / length
    if (table.point is None) == (table.offset is None):
        faults.add((*place, "offset"), "give either a point of the plane or its offset along the normal")
    offset = table.offset if table.point is None else float(normal @ np.array(table.point))
    x, y, z = (float(c) for c in normal)
    return PlanePlan(table.name, (x, y, z), offset or 0.0, states(table))


def read_contact(table: ContactTable) -> Law:
    """The law where nothing else is stated."""
    given = table.model_dump(exclude={"damping"})
    return Law(**given) if table.damping is None else Law(**given, damping=table.damping)


def read_pairs(tables: Sequence[PairTable], names: Sequence[str], faults: Faults) -> tuple[PairPlan, ...]:
    """The [[pair]] tables; notes names that do not exist and pairs that are stated twice."""
    pairs: list[PairPlan] = []
    for index, table in enumerate(tables):
        place = ("pair", index)
        a, b = table.between
        for name in table.between:
            if name not in names:
                faults.add((*place, "between"), f"no body or plane is called {quote(name)}; {hint(name, names)}")
        between = frozenset((a, b))
        if a == b:
            faults.add((*place, "between"), "names the same surface twice")
        if any(pair.between == between for pair in pairs):
            faults.add((*place, "between"), f"{a} and {b} already have a [[pair]] table")
        own = states(table) | {
            key: value for key in ("frequency", "damping") if (value := getattr(table, key)) is not None
        }
        if own and not table.collide:
            faults.add((*place, "collide"), f"with false, {', '.join(own)} would have no effect; leave one out")
        pairs.append(PairPlan(f"{a}-{b}", between, table.collide, own))
    return tuple(pairs)


def check_mates(bodies: Sequence[BodyPlan], names: Sequence[str], document: Document, faults: Faults) -> None:
    """Every name in collides_with must be another body's or a plane's."""
    for index, body in enumerate(bodies):
        for name in document.body[index].collides_with or ():
            others = [other for other in names if other != body.name]
            if name not in others:
                message = f"no other body and no plane is called {quote(name)}; {hint(name, others)}"
                faults.add(("body", index, "collides_with"), message)


def check_count(bodies: Sequence[BodyPlan], planes: Sequence[PlanePlan], faults: Faults) -> None:
    """All pairs of surfaces are looked at in every step, so there must not be too many."""
    counts = [len(body.spheres) for body in bodies]
    total = sum(counts)
    pairs = (total * total - sum(count * count for count in counts)) // 2 + total * len(planes)
    if pairs > MAX_PAIRS:
        faults.stop(("body",), f"{pairs} pairs of surfaces could meet; at most {MAX_PAIRS} are allowed")


def check_laws(plan: WorldPlan, faults: Faults) -> None:
    """A contact is either soft or has restitution; a [[pair]] table must belong to surfaces that may touch."""
    laws = {frozenset(plan.owners(pair)): pair.law for pair in plan.world({}).pairs}
    for owners, law in laws.items():
        if law.soft and law.restitution:
            faults.add(law_place(plan, owners), f"{' and '.join(sorted(owners))}: {either(law)}")
    for index, pair in enumerate(plan.pairs):
        if pair.collide and pair.between not in laws:
            faults.add(("pair", index, "between"), "these two never touch, so that nothing can be stated about them")
    check_damping(plan, faults)


def check_varied(plan: WorldPlan, variables: Sequence[Variable | None], faults: Faults) -> None:
    """A variable must not give restitution to soft contacts."""
    soft = {name for pair in plan.world({}).pairs if pair.law.soft for name in plan.owners(pair)}
    soft |= {pair.name for pair in plan.pairs if pair.states.get("frequency", plan.contact.frequency)}
    for index, variable in enumerate(variables):
        for slot in variable.slots if variable else ():
            owner, _, key = slot.name.rpartition(".")
            if key == "restitution" and owner in soft:
                text = f"{slot.name} cannot vary: {owner} has soft contacts, which have no restitution"
                faults.add(("variable", index, "sets"), text)


def either(law: Law) -> str:
    """The message for a contact that is both."""
    return (
        f"a contact is either soft (frequency {law.frequency:g} Hz) or has restitution ({law.restitution:g}); "
        "leave one out, or make one of them 0 for these two in a [[pair]] table"
    )


def law_place(plan: WorldPlan, owners: frozenset[str]) -> Place:
    """Where the frequency of a pair is stated."""
    for index, pair in enumerate(plan.pairs):
        if pair.between == owners and "frequency" in pair.states:
            return ("pair", index, "frequency")
    return ("contact", "frequency")


def check_damping(plan: WorldPlan, faults: Faults) -> None:
    """Damping without softness would have no effect."""
    stated = faults.data.get("contact", {})
    soft = plan.contact.soft or any(pair.states.get("frequency") for pair in plan.pairs)
    if "damping" in stated and not soft:
        faults.add(("contact", "damping"), "has no effect on rigid contacts; give frequency too")
    for index, pair in enumerate(plan.pairs):
        if "damping" in pair.states and not pair.states.get("frequency", plan.contact.frequency):
            faults.add(("pair", index, "damping"), "has no effect on a rigid contact; give frequency too")
