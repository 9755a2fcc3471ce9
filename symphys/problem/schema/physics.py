"""Tables that say what there is and how time passes: simulation, world, bodies, static surfaces, contact."""

from __future__ import annotations

from dataclasses import fields
from typing import Annotated

from pydantic import Field

from symphys.model.world import GRAVITY, Law, Scheme
from symphys.problem.schema.declared import table_of
from symphys.problem.schema.shapes import UPRIGHT, ShapeTable, SolidTable
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
    """Duration, time step and settings of the integrator."""

    duration: Positive | None = Field(
        default=None,
        description="simulated time [s], a whole number of steps; default: up to the last [[recording]] sample",
    )
    dt: Positive = Field(description="time step [s]")
    sweeps: Sweeps = Field(
        default=DEFAULT.sweeps, description="projected Gauss-Seidel sweeps over the contacts in each step"
    )
    position_sweeps: PositionSweeps = Field(
        default=DEFAULT.position_sweeps, description="sweeps of the pass that removes penetration"
    )
    warm_start: bool = Field(
        default=DEFAULT.warm_start, description="start each step from the previous step's contact forces"
    )
    smoothing: Smoothing = Field(
        default=0.0,
        validate_default=True,
        description="width of the smoothed contact law [m/s]; 0 is exact. A list gives stages: [0.1, 0.01, 0]",
    )
    push_out: Share = Field(default=DEFAULT.push_out, description="share of a penetration that one step removes")
    time_of_impact: bool = Field(
        default=DEFAULT.time_of_impact, description="locate each impact within its step; gradients are wrong without it"
    )
    impact_friction: bool = Field(
        default=DEFAULT.impact_friction, description="evaluate friction of an impact at the instant of the impact"
    )
    cuts: Cuts | None = Field(
        default=DEFAULT.cuts,
        description="how often an impact may split a step, which costs another step; with 0, gradients are wrong "
        "where a body is hit while it touches another. Default: 2 if bodies can be hit off centre (boxes), else 1",
    )
    energy_cap: bool = Field(default=DEFAULT.energy_cap, description="limit restitution so that no impact adds energy")
    load_sharing: bool = Field(
        default=DEFAULT.load_sharing,
        description="distribute loads linearly over coplanar contact points, independently of the history",
    )
    newton_start: bool = Field(
        default=DEFAULT.newton_start,
        description="solve a few bodies' constraints together before the sweeps; settles several feet, wheels or "
        "simultaneous impacts",
    )


class WorldTable(SchemaTable):
    """Gravity."""

    gravity: Vector = Field(default=list(GRAVITY), description="acceleration of free bodies [m/s^2]")


STATED = [each for each in fields(Law) if "combine" in each.metadata]
"""Coefficients that surfaces state."""
REST = [each for each in fields(Law) if "combine" not in each.metadata]


class SurfaceTable(table_of("StatedTable", STATED, optional=True)):  # type: ignore[misc]
    """Contact properties of one surface.

    Two touching surfaces multiply their friction and restitution, and add torsion and rolling. A value that neither
    states comes from [contact]. A [[pair]] table overrides all.
    """


class MemberTable(SurfaceTable):
    """A surface that may belong to a group."""

    group: Identifier | None = Field(
        default=None, description="a name that several surfaces share, for collides_with and [[pair]]"
    )
    collides_with: list[str] | None = Field(
        default=None, description="bodies, static surfaces and groups that it may touch; default: all"
    )


class BodyTable(MemberTable):
    """A rigid body and its initial state, in world coordinates."""

    name: Identifier = Field(description="its name in formulas")
    shape: ShapeTable | None = Field(default=None, description="without a shape, the body touches nothing")
    mass: NonNegative | None = Field(
        default=None,
        description="mass of the whole body [kg]; needed unless density is given; 0: a frame between two joints",
    )
    density: Positive | None = Field(default=None, description="[kg/m^3], instead of mass, for solid shapes")
    inertia: Inertia | None = Field(
        default=None,
        description="about the centre of mass [kg m^2]: a number, principal moments or a 3 x 3 matrix; default: from "
        "shape and mass",
    )
    position: Vector = Field(default=[0.0, 0.0, 0.0], description="position of the centre of mass [m]")
    orientation: Orientation = Field(default=[1.0, 0.0, 0.0, 0.0], description=UPRIGHT)
    velocity: Vector = Field(default=[0.0, 0.0, 0.0], description="initial velocity of the centre of mass [m/s]")
    angular_velocity: Vector = Field(
        default=[0.0, 0.0, 0.0], description="initial angular velocity, world axes [rad/s]"
    )


class GroundTable(MemberTable):
    """The horizontal plane named ground."""

    height: Finite = Field(default=0.0, description="z of the surface [m]")


class PlaneTable(MemberTable):
    """A static plane: everything behind it is solid."""

    name: Identifier = Field(description="its name in pairs and settings")
    normal: Vector = Field(description="points out of the wall; any length but 0")
    point: Vector | None = Field(default=None, description="any point of the plane [m]")
    offset: Finite | None = Field(
        default=None, description="instead of point: distance from the origin along the normal [m]"
    )


class BlockTable(MemberTable):
    """A static solid: a ramp, a step, a post."""

    name: Identifier = Field(description="its name in pairs, formulas and settings")
    shape: SolidTable = Field(description="one of the shapes")
    position: Vector = Field(default=[0.0, 0.0, 0.0], description="position of its centre [m]")
    orientation: Orientation = Field(default=[1.0, 0.0, 0.0, 0.0], description=UPRIGHT)


class TerrainTable(MemberTable):
    """Static uneven ground, from a formula or a grid of heights; everything below is solid."""

    name: Identifier = Field(description="its name in pairs and settings")
    height: str | None = Field(
        default=None, description='formula of x and y [m], twice differentiable: "0.1 * sin(3 * x)"'
    )
    heights: Grid | None = Field(
        default=None,
        description="instead of height: z [m] on a grid, rows along y, columns along x; the surface does not overshoot",
    )
    spacing: Spacing | None = Field(default=None, description="grid spacing [m]: a number, or [along x, along y]")
    origin: Pair | None = Field(default=None, description="x and y of the first height [m]; default [0, 0]")


class ContactTable(table_of("LawTable", fields(Law))):  # type: ignore[misc]
    """Default contact properties."""


class PairTable(table_of("PairLawTable", REST, base=SurfaceTable, optional=True)):  # type: ignore[misc]
    """Contact properties of a pair of surfaces, which replace their own."""

    between: Annotated[list[str], Field(min_length=2, max_length=2)] = Field(
        description="two surfaces or groups; names of surfaces take precedence over groups"
    )
    collide: bool = Field(default=True, description="false: the two pass through each other")
