"""The [[scenario]] tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from symphys.model.joints.frames import WORLD
from symphys.model.joints.start import spanning_tree
from symphys.model.state_layout import GIVEN
from symphys.problem.model import (
    Discretisation,
    RandomizedPose,
    RandomizedQuantity,
    Scenarios,
    Simulation,
    Variable,
    VariableSlot,
)
from symphys.problem.parametric.joints import ParametricJoint
from symphys.problem.parametric.placement import check_carried
from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.quantities import Quantity, SlotError, limits, read_slot
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.schema.scenarios import DiscretisationTable, ScenarioTable
from symphys.problem.tables.simulation import check_steps
from symphys.suggest import hint, quote
from symphys.types import Array

Taken = dict[tuple[str, int], str]
"""What sets each component of each quantity, in words."""
KINDS = ("sets", "robot", "simulation")


def read_scenarios(
    tables: Sequence[ScenarioTable],
    known: Mapping[str, Quantity],
    parametric: ParametricWorld,
    simulation: Simulation,
    variables: Sequence[Variable],
    faults: Faults,
) -> Scenarios:
    """Read the tables; a quantity that a variable sets cannot differ, nor can one differ twice."""
    taken: Taken = {}
    for variable in variables:
        for slot in variable.slots:
            taken |= {(slot.name, k): f"variable {variable.name}" for k in slot.components}
    reader = ScenarioReader(known, parametric, simulation, taken, faults)
    for index, table in enumerate(tables):
        reader.read(index, table)
    return Scenarios(tuple(reader.quantities), tuple(reader.poses), tuple(reader.discretisations))


class ScenarioReader:
    """Reads one table after the other."""

    def __init__(
        self,
        known: Mapping[str, Quantity],
        parametric: ParametricWorld,
        simulation: Simulation,
        taken: Taken,
        faults: Faults,
    ) -> None:
        """Prepare to read the tables."""
        self.known, self.parametric, self.simulation = known, parametric, simulation
        self.taken, self.faults = taken, faults
        self.quantities: list[RandomizedQuantity] = []
        self.poses: list[RandomizedPose] = []
        self.discretisations: list[Discretisation] = []

    def read(self, index: int, table: ScenarioTable) -> None:
        """Read a table."""
        place: Place = ("scenario", index)
        given = [key for key in KINDS if getattr(table, key) is not None]
        if len(given) != 1:
            self.faults.add((*place, "sets"), "give one of sets, robot and simulation")
        elif table.sets is not None:
            self.numbers(place, table)
        elif table.robot is not None:
            self.pose(place, table, table.robot)
        elif table.simulation is not None:
            self.grid(place, table.name, table.simulation)

    def numbers(self, place: Place, table: ScenarioTable) -> None:
        """Numbers that are sampled."""
        try:
            slots = tuple(read_slot(text, self.known) for text in table.sets or ())
        except SlotError as error:
            self.faults.add((*place, "sets"), str(error))
            return
        kinds, sizes = {self.known[slot.name].kind for slot in slots}, {len(slot.components) for slot in slots}
        if len(kinds) > 1 or len(sizes) > 1:
            self.faults.add((*place, "sets"), "these are of different kinds or lengths; use one scenario for each")
            return
        if (table.factor is None) == (table.shift is None):
            self.faults.add((*place, "factor"), "give either factor or shift")
            return
        self.take((*place, "sets"), slots, table.name)
        check_carried(self.parametric, [((*place, "sets"), slot.name) for slot in slots], self.faults)
        shift = np.array([0.0] if table.shift is None else table.shift)
        if shift.size not in (1, *sizes):
            self.faults.add((*place, "shift"), f"must be a number, or {max(sizes)} of them; it has {shift.size}")
            return
        kind, spread = kinds.pop(), np.broadcast_to(np.abs(shift), (max(sizes),)).copy()
        self.check_lasting((*place, "lasts"), table.lasts, kind)
        lower, upper = (np.stack(ends) for ends in zip(*(limits(slot, self.known) for slot in slots), strict=True))
        self.check_physical((*place, "shift"), slots, spread, lower, upper)
        factor, lasts = table.factor or 0.0, table.lasts or 0.0
        self.quantities.append(
            RandomizedQuantity(table.name, kind, slots, factor, spread, table.alike, lasts, lower, upper)
        )

    def check_lasting(self, place: Place, seconds: float | None, kind: str) -> None:
        """Inputs alone last, and not beyond the motion."""
        if seconds is not None and kind != "control":
            self.faults.add(place, "only forces, torques and commands act for a while; leave this out")
        elif seconds is not None and seconds > self.simulation.duration:
            self.faults.add(place, f"is longer than the motion, {self.simulation.duration:g} s")

    def check_physical(
        self, place: Place, slots: Sequence[VariableSlot], shift: Array, lower: Array, upper: Array
    ) -> None:
        """Check that shifts do not lead beyond what is physical."""
        for slot, low, high in zip(slots, lower, upper, strict=True):
            nominal = self.known[slot.name].nominal[list(slot.components)]
            if np.any(shift > 0) and (np.any(nominal - shift < low) or np.any(nominal + shift > high)):
                ends = f"{np.min(nominal - shift):g} to {np.max(nominal + shift):g}"
                self.faults.add(
                    place, f"would take {slot.name} from {ends}; physical is {low.max():g} to {high.min():g}"
                )

    def take(self, place: Place, slots: Sequence[VariableSlot], name: str) -> None:
        """Note who sets what; refuse second ones."""
        for slot in slots:
            for k in slot.components:
                owner = self.taken.setdefault((slot.name, k), f"scenario {name}")
                if owner != f"scenario {name}":
                    self.faults.add(place, f"{slot.name}[{k}] is set by {owner} already")
                    return

    def pose(self, place: Place, table: ScenarioTable, robot: str) -> None:
        """A robot whose pose is sampled."""
        bodies = [body.name for body in self.parametric.bodies]
        if robot not in bodies:
            self.faults.add((*place, "robot"), f"there is no body {quote(robot)}; {hint(robot, bodies)}")
            return
        whole = together(robot, self.parametric.joints)
        if WORLD in whole:
            self.faults.add((*place, "robot"), f"{robot} hangs on the world; only what moves freely has a pose")
            return
        slots = [
            VariableSlot(name, tuple(range(self.known[name].nominal.size)))
            for name in (f"{body}.{field}" for body in whole for field in GIVEN)
        ]
        self.take((*place, "robot"), slots, table.name)
        tilt, bend = table.tilt + np.deg2rad(table.tilt_deg), table.joints + np.deg2rad(table.joints_deg)
        if not (tilt or bend or table.velocity):
            self.faults.add((*place, "tilt"), "give tilt, joints or velocity, or several of them")
        joints = bending(self.parametric.joints, whole)
        self.poses.append(RandomizedPose(table.name, tuple(whole), joints, float(tilt), float(bend), table.velocity))

    def grid(self, place: Place, name: str, table: DiscretisationTable) -> None:
        """Another discretisation."""
        given = {key: value for key in ("dt", "sweeps") if (value := getattr(table, key)) is not None}
        if not given:
            self.faults.add((*place, "simulation"), "give dt, sweeps or both")
        if table.dt is not None:
            check_steps(self.simulation.duration, table.dt, self.faults, (*place, "simulation", "dt"))
        self.discretisations.append(Discretisation(name, replace(self.simulation, **given)))


def together(body: str, joints: Sequence[ParametricJoint]) -> list[str]:
    """The bodies that joints hold together with one, the world too."""
    found = {body: None}
    while True:
        ends = [{joint.first, joint.second or WORLD} for joint in joints]
        more = [name for pair in ends if pair & found.keys() for name in sorted(pair) if name not in found]
        if not more:
            return list(found)
        found |= dict.fromkeys(more)


def bending(joints: Sequence[ParametricJoint], bodies: Sequence[str]) -> tuple[ParametricJoint, ...]:
    """The rigid hinges of a robot that close no loop."""
    tree = spanning_tree(joints)
    return tuple(
        joint
        for joint in joints
        if joint.first in bodies
        and joint.name in tree[joint.first]
        and [each.turns and not each.slides for each in joint.kind.coordinates] == [True]
    )
