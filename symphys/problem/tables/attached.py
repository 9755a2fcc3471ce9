"""The [[site]] and [[coupling]] tables: what is attached to bodies and joints that are there."""

from __future__ import annotations

from collections.abc import Sequence

from symphys.model.joints import kinematic_trees
from symphys.model.joints.coupling import DEGREE, CouplingSpec
from symphys.model.joints.frames import WORLD
from symphys.model.world import World
from symphys.problem.parametric.joints import ParametricJoint
from symphys.problem.parametric.parts import ParametricSite
from symphys.problem.reading.faults import Faults
from symphys.problem.schema.joints import CouplingTable, SiteTable
from symphys.problem.tables.shapes import read_orientation
from symphys.suggest import hint, quote


def read_sites(tables: Sequence[SiteTable], bodies: Sequence[str], faults: Faults) -> tuple[ParametricSite, ...]:
    """The sites; notes bodies that there are none of."""
    found = []
    for index, table in enumerate(tables):
        if table.body != WORLD and table.body not in bodies:
            text = f"no body is called {quote(table.body)}; {hint(table.body, [WORLD, *bodies])}"
            faults.add(("site", index, "body"), text)
        x, y, z = table.position
        orientation = read_orientation(("site", index, "orientation"), table.orientation, faults)
        body = None if table.body == WORLD else table.body
        found.append(ParametricSite(table.name, body, (x, y, z), tuple(orientation.tolist())))
    return tuple(found)


def check_couplings(world: World, faults: Faults) -> None:
    """The joints of a coupling must be of one kinematic tree."""
    for index, coupling in enumerate(world.couplings):
        ends = {k for k in (coupling.first, coupling.second) if k is not None}
        trees = [{link.joint for link in tree.links} for tree in kinematic_trees(world.joints)]
        if not any(ends <= tree for tree in trees):
            names = " and ".join(world.joints[k].name for k in sorted(ends))
            text = f"{names} must be joints of one robot, and close no loop: they have no coordinates in common else"
            faults.add(("coupling", index, "joints"), text)


def read_couplings(
    tables: Sequence[CouplingTable], joints: Sequence[ParametricJoint], faults: Faults
) -> tuple[CouplingSpec, ...]:
    """The couplings; notes joints that there are none of, or that have not one coordinate."""
    known, found = {joint.name: joint for joint in joints}, []
    for index, table in enumerate(tables):
        place = ("coupling", index, "joints")
        for name in table.joints:
            if name not in known:
                faults.add(place, f"no joint is called {quote(name)}; {hint(name, known)}")
            elif len(known[name].kind.coordinates) != 1 or known[name].frequency:
                faults.add(place, f"{name} must be a rigid hinge or slider, which has one coordinate")
        if len(set(table.joints)) != len(table.joints):
            faults.add(place, "names the same joint twice")
        polynomial = (*table.polynomial, *(0.0,) * (DEGREE + 1 - len(table.polynomial)))
        found.append(CouplingSpec(table.name, tuple(table.joints), polynomial))
    return tuple(found)
