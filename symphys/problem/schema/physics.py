"""Tables that say what there is and how time passes: simulation, world, bodies, static surfaces, contact."""

from __future__ import annotations

from dataclasses import fields
from typing import Annotated

from pydantic import Field

from symphys.model.world import GRAVITY, Law, Scheme
from symphys.problem.schema.declared import table_of
from symphys.problem.schema.shapes import EXAMPLES, UPRIGHT, ShapeTable, SolidTable
from symphys.problem.schema.types import (
    Finite,
    Grid,
    Identifier,
    Inertia,
    NonNegative,
    Orientation,
    Pair,
    Positive,
    SchemaTable,
    Share,
    Smoothing,
    Spacing,
    Vector,
)

Sweeps = Annotated[int, Field(ge=1, le=1000)]
PositionSweeps = Annotated[int, Field(ge=0, le=1000)]
Cuts = Annotated[int, Field(ge=0, le=8)]
DEFAULT = Scheme()


class SimulationTable(SchemaTable):
    """Duration, time step and settings of the integration."""

    duration: Positive | None = Field(
        default=None,
        description="how long to simulate [s]; a whole number of time steps; needed unless there are [[recording]] "
        "tables, up to whose last sample it then goes",
    )
    dt: Positive = Field(description="time step [s]")
    sweeps: Sweeps = Field(
        default=DEFAULT.sweeps, description="projected Gauss-Seidel sweeps over the contacts in each step"
    )
    position_sweeps: PositionSweeps = Field(
        default=DEFAULT.position_sweeps, description="sweeps of the pass that removes penetration"
    )
    warm_start: bool = Field(
        default=DEFAULT.warm_start, description="start each step from the last one's contact forces"
    )
    smoothing: Smoothing = Field(
        default=0.0,
        validate_default=True,
        description="width [m/s] of the smooth contact law for solvers; 0 is exact. A list is stages, such as "
        "[0.1, 0.01, 0]: each starts where the one before ended",
    )
    push_out: Share = Field(default=DEFAULT.push_out, description="share of a penetration that one step removes")
    time_of_impact: bool = Field(
        default=DEFAULT.time_of_impact, description="find the instant of each impact; without it gradients are wrong"
    )
    impact_friction: bool = Field(
        default=DEFAULT.impact_friction, description="friction at an impact aims at the velocity at that instant"
    )
    cuts: Cuts | None = Field(
        default=DEFAULT.cuts,
        description="how often a step may be cut at an impact, so that impacts are taken one after the other; each "
        "adds the work of a step. With 0 gradients of a body that is hit while it touches another are wrong. "
        "Default: 2 where bodies may be hit off their centres, as boxes are, else 1",
    )
    energy_cap: bool = Field(
        default=DEFAULT.energy_cap, description="no impact adds energy, which restitution with friction can"
    )
    load_sharing: bool = Field(
        default=DEFAULT.load_sharing,
        description="points of a body that lie in a plane share their load linearly; without it the share depends on "
        "all that was before",
    )
    newton_start: bool = Field(
        default=DEFAULT.newton_start,
        description="all constraints on a few bodies are solved together before the sweeps: what several faces, wheels "
        "or feet carry is shared by least squares, and impacts on points close together settle",
    )


class WorldTable(SchemaTable):
    """Gravity, which acts on every body."""

    gravity: Vector = Field(
        default=list(GRAVITY), description="acceleration of free bodies [m/s^2], for instance [0, 0, -9.81]"
    )


STATED = [each for each in fields(Law) if "combine" in each.metadata]
"""Coefficients that surfaces state."""
REST = [each for each in fields(Law) if "combine" not in each.metadata]


class SurfaceTable(table_of("StatedTable", STATED, optional=True)):  # type: ignore[misc]
    """Contact properties of one surface.

    Friction and restitution of a contact are the product of what its two surfaces state, torsion and rolling their
    sum; if neither surface states it, the one in [contact] holds; a [[pair]] table overrides all.
    """


class MemberTable(SurfaceTable):
    """A surface that may belong to a group."""

    group: Identifier | None = Field(
        default=None, description="a name shared by several surfaces, for collides_with and [[pair]]"
    )
    collides_with: list[str] | None = Field(
        default=None, description="names of the bodies, static surfaces and groups that it may touch; default: all"
    )


class BodyTable(MemberTable):
    """A rigid body and its state at the start, in world coordinates."""

    name: Identifier = Field(description="how formulas refer to it")
    shape: ShapeTable | None = Field(default=None, description="its surface; without one it touches nothing")
    mass: NonNegative | None = Field(
        default=None,
        description="of the whole body [kg]; needed unless density is given; 0: a frame between two joints",
    )
    density: Positive | None = Field(default=None, description="[kg/m^3], instead of mass, for solid shapes")
    inertia: Inertia | None = Field(
        default=None,
        description="about the centre of mass [kg m^2]: a number, three principal moments or a 3 x 3 matrix",
    )
    position: Vector = Field(default=[0.0, 0.0, 0.0], description="of the centre of mass [m]")
    orientation: Orientation = Field(default=[1.0, 0.0, 0.0, 0.0], description=UPRIGHT)
    velocity: Vector = Field(default=[0.0, 0.0, 0.0], description="of the centre of mass at the start [m/s]")
    angular_velocity: Vector = Field(default=[0.0, 0.0, 0.0], description="at the start, world axes [rad/s]")


class GroundTable(MemberTable):
    """The floor: the horizontal plane called ground."""

    height: Finite = Field(default=0.0, description="z of the surface [m]")


class PlaneTable(MemberTable):
    """A static wall: everything behind the plane is solid."""

    name: Identifier = Field(description="how pairs and settings refer to it")
    normal: Vector = Field(description="out of the wall, any length but 0")
    point: Vector | None = Field(default=None, description="any point of the plane [m]")
    offset: Finite | None = Field(
        default=None, description="distance of the plane from the origin along the normal [m]"
    )


class BlockTable(MemberTable):
    """A static solid: a ramp, a step, a post, a wall with an end."""

    name: Identifier = Field(description="how pairs, formulas and settings refer to it")
    shape: SolidTable = Field(description=f"its surface: {EXAMPLES}")
    position: Vector = Field(default=[0.0, 0.0, 0.0], description="of its centre [m]")
    orientation: Orientation = Field(default=[1.0, 0.0, 0.0, 0.0], description=UPRIGHT)


class TerrainTable(MemberTable):
    """Static ground of varying height: everything below is solid. Either a formula, or a grid of heights."""

    name: Identifier = Field(description="how pairs and settings refer to it")
    height: str | None = Field(
        default=None, description='formula of x and y [m], twice differentiable: "0.1 * sin(3 * x)"'
    )
    heights: Grid | None = Field(
        default=None,
        description="z [m] on a grid, rows along y, columns along x; a smooth surface through them, within the range "
        "of the four around a place, that goes straight on beyond the edges",
    )
    spacing: Spacing | None = Field(default=None, description="of the grid [m]: a number, or [along x, along y]")
    origin: Pair | None = Field(default=None, description="x and y of the first height [m]; default [0, 0]")


class ContactTable(table_of("LawTable", fields(Law))):  # type: ignore[misc]
    """The law of contacts for which no surface and no pair states anything else."""


class PairTable(table_of("PairLawTable", REST, base=SurfaceTable, optional=True)):  # type: ignore[misc]
    """Contact properties of a pair of surfaces, in place of their own."""

    between: Annotated[list[str], Field(min_length=2, max_length=2)] = Field(
        description="two names of surfaces or groups; a table with two surfaces' names beats one with a group, and "
        "that one a table with two groups"
    )
    collide: bool = Field(default=True, description="false: the two pass through each other")
