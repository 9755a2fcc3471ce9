"""Included files in their places: what they bring is turned about the z axis, then shifted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import hypot
from typing import Any

import numpy as np

from symphys.model.joints import JOINTS
from symphys.model.joints.frames import WORLD
from symphys.model.orientation import turned
from symphys.problem.include.merge import MergedFiles
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.schema import Document, SchemaTable
from symphys.problem.schema.include import IncludeTable
from symphys.problem.schema.joints import JointTable, SiteTable
from symphys.problem.schema.physics import BlockTable, BodyTable, PlaneTable, TerrainTable
from symphys.problem.tables.shapes import read_orientation


def placed(document: Document, merged: MergedFiles, faults: Faults) -> Document:
    """The document with the tables of included files where these were put.

    Bodies, joints, planes and blocks move. The ground stays, and so does what variables set and formulas say. Terrain
    cannot move; a fault says so.
    """
    changed = {key: list(getattr(document, key)) for key in MOVES}
    for include, ranges in merged.moves:
        shift = Placement(include, faults)
        if not shift.moves:
            continue
        for key, move in MOVES.items():
            for index in ranges.get(key, ()):
                changed[key][index] = move(shift, (key, index), changed[key][index])
    return document.model_copy(update=changed)


@dataclass(frozen=True)
class Placement:
    """A turn about the z axis of the world, then a shift."""

    include: IncludeTable
    faults: Faults

    @property
    def moves(self) -> bool:
        """Whether anything changes."""
        return any(self.include.position) or self.include.yaw_deg != 0

    def direction(self, vector: Sequence[float]) -> list[float]:
        """(3,) turned."""
        angle = np.deg2rad(self.include.yaw_deg)
        cos, sin = float(np.cos(angle)), float(np.sin(angle))
        x, y, z = vector
        return [cos * x - sin * y, sin * x + cos * y, z]

    def point(self, vector: Sequence[float]) -> list[float]:
        """(3,) turned and shifted."""
        return [a + b for a, b in zip(self.direction(vector), self.include.position, strict=True)]

    def orientation(self, place: Place, given: Any) -> Any:
        """Return the orientation of the file, turned."""
        if not self.include.yaw_deg:
            return given
        return turned(read_orientation((*place, "orientation"), given, self.faults), 2, self.include.yaw_deg).tolist()

    def body(self, place: Place, table: BodyTable) -> SchemaTable:
        """A body, with its velocities."""
        update = {
            "position": self.point(table.position),
            "orientation": self.orientation(place, table.orientation),
            "velocity": self.direction(table.velocity),
            "angular_velocity": self.direction(table.angular_velocity),
        }
        return copied(table, update)

    def block(self, place: Place, table: BlockTable) -> SchemaTable:
        """A static solid."""
        update = {
            "position": self.point(table.position),
            "orientation": self.orientation(place, table.orientation),
        }
        return copied(table, update)

    def plane(self, place: Place, table: PlaneTable) -> SchemaTable:
        """A static wall."""
        update: dict[str, Any] = {"normal": self.direction(table.normal)}
        if table.point is not None:
            update["point"] = self.point(table.point)
        if table.offset is not None:
            unit = np.array(update["normal"]) / (hypot(*table.normal) or 1.0)
            update["offset"] = table.offset + float(unit @ np.array(self.include.position))
        return copied(table, update)

    def joint(self, place: Place, table: JointTable) -> SchemaTable:
        """A joint: its point, axes, and an anchor on the world."""
        update: dict[str, Any] = {}
        if table.point is not None:
            update["point"] = self.point(table.point)
        if table.anchors is not None:
            sides = zip(table.between, table.anchors, strict=True)
            update["anchors"] = [self.point(anchor) if name == WORLD else anchor for name, anchor in sides]
        for word, spec in JOINTS.items():
            if (own := getattr(table, word)) is not None:
                moved: dict[str, Any] = {}
                for each in spec.own_fields():
                    given, value = getattr(own, each.name), each.metadata["value"]
                    if value == "direction":
                        moved[each.name] = self.direction(given)
                    elif value == "directions":
                        moved[each.name] = [self.direction(axis) for axis in given]
                update[word] = own.model_copy(update=moved)
        placed: SchemaTable = table.model_copy(update=update)
        return placed

    def site(self, place: Place, table: SiteTable) -> SchemaTable:
        """A site of the world; one of a body moves with that."""
        if table.body != WORLD:
            return table
        orientation = self.orientation(place, table.orientation)
        return table.model_copy(update={"position": self.point(table.position), "orientation": orientation})

    def terrain(self, place: Place, table: TerrainTable) -> SchemaTable:
        """Terrain stays."""
        text = "terrain cannot be moved; include this file without position and yaw_deg, or take the terrain out of it"
        self.faults.add(place, text)
        return table


MOVES: dict[str, Callable[[Placement, Place, Any], SchemaTable]] = {
    "body": Placement.body,
    "joint": Placement.joint,
    "site": Placement.site,
    "plane": Placement.plane,
    "block": Placement.block,
    "terrain": Placement.terrain,
}


def copied(table: SchemaTable, update: Mapping[str, Any]) -> SchemaTable:
    """Return a table with other values of some keys."""
    return table.model_copy(update=update)
