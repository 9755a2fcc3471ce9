"""What stands still: the ground, planes, blocks and terrain."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np

from symphys.model.shapes import Fixture, Plane, Sphere
from symphys.problem.parametric.parts import ParametricStatic
from symphys.problem.reading.faults import Faults
from symphys.problem.schema import Document
from symphys.problem.schema.physics import BlockTable, GroundTable, PlaneTable
from symphys.problem.tables.bodies import states
from symphys.problem.tables.shapes import read_orientation, read_solid, three
from symphys.problem.tables.terrain import read_terrain


def read_statics(document: Document, starts: Sequence[Sequence[float]], faults: Faults) -> tuple[ParametricStatic, ...]:
    """The ground, if there is one, then planes, blocks and terrain; ``starts``: where bodies are at first."""
    ground = () if document.ground is None else (read_ground(document.ground),)
    planes = tuple(read_plane(i, table, faults) for i, table in enumerate(document.plane))
    blocks = tuple(read_block(i, table, faults) for i, table in enumerate(document.block))
    terrain = tuple(read_terrain(i, table, starts, faults) for i, table in enumerate(document.terrain))
    return (*ground, *planes, *blocks, *terrain)


def read_ground(table: GroundTable) -> ParametricStatic:
    """The horizontal plane called ground."""
    return ParametricStatic(Plane.ground(table.height), states(table), table.group)


def read_plane(index: int, table: PlaneTable, faults: Faults) -> ParametricStatic:
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
    plane = Plane(table.name, three(normal.tolist()), offset or 0.0)
    return ParametricStatic(plane, states(table), table.group)


def read_block(index: int, table: BlockTable, faults: Faults) -> ParametricStatic:
    """One static solid."""
    place = ("block", index)
    orientation = read_orientation((*place, "orientation"), table.orientation, faults)
    shape = read_solid((*place, "shape"), table.shape, table.position, orientation, faults)
    return ParametricStatic(Fixture(table.name, shape or Sphere(1.0)), states(table), table.group)
