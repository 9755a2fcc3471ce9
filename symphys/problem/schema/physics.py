"""Tables that say what there is and how time passes: simulation, world, bodies, planes, contact."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from symphys.problem.schema.types import (
    Finite,
    Identifier,
    Inertia,
    NonNegative,
    Orientation,
    Positive,
    Share,
    Smoothing,
    Table,
    Vector,
)
from symphys.world import GRAVITY, Scheme

Sweeps = Annotated[int, Field(ge=1, le=1000)]
PositionSweeps = Annotated[int, Field(ge=0, le=1000)]
DEFAULT = Scheme()


class SimulationTable(Table):
    """How time passes."""

    duration: Positive = Field(description="how long to simulate [s]; a whole number of time steps")
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
    split: bool = Field(
        default=DEFAULT.split,
        description="cut steps at the first impact where bodies have several contacts; without it gradients of a body "
        "that is hit while it touches another are wrong",
    )


class WorldTable(Table):
    """What acts everywhere."""

    gravity: Vector = Field(default=list(GRAVITY), description="[m/s^2], for instance [0, 0, -9.81]")


class SurfaceTable(Table):
    """What one surface brings into its contacts.

    Friction and restitution of a contact are the product of what its two surfaces state, torsion and rolling their
    sum; if neither surface states it, the one in [contact] holds; a [[pair]] table overrides all.
    """

    friction: NonNegative | None = Field(
        default=None, description="Coulomb's coefficient; two stated ones are multiplied"
    )
    restitution: Share | None = Field(
        default=None, description="share of the speed after a bounce; stated ones are multiplied"
    )
    torsion: NonNegative | None = Field(default=None, description="resists spinning about the normal: a radius [m]")
    rolling: NonNegative | None = Field(default=None, description="resists rolling: a radius [m]")


class SphereTable(Table):
    """A sphere about the centre of mass."""

    radius: Positive = Field(description="[m]")
    hollow: bool = Field(
        default=False, description="a thin shell instead of a solid sphere: I = 2/3 m r^2 instead of 2/5"
    )


class PartTable(Table):
    """One sphere of a compound."""

    radius: Positive = Field(description="[m]")
    centre: Vector = Field(default=[0.0, 0.0, 0.0], description="[m], from the centre of mass, in the body's frame")


class ShapeTable(Table):
    """Either one sphere or several."""

    sphere: SphereTable | None = Field(default=None, description="{ radius = 0.5 }")
    spheres: list[PartTable] | None = Field(
        default=None,
        min_length=1,
        max_length=1000,
        description="a compound: [{ radius = 0.1, centre = [0.2, 0, 0] }, ...]",
    )


class BodyTable(SurfaceTable):
    """A rigid body and its state at the start, in world coordinates."""

    name: Identifier = Field(description="how formulas refer to it")
    shape: ShapeTable | None = Field(default=None, description="its surface; without one it touches nothing")
    mass: Positive | None = Field(default=None, description="[kg]")
    density: Positive | None = Field(default=None, description="[kg/m^3], instead of mass, for solid spheres")
    inertia: Inertia | None = Field(
        default=None,
        description="about the centre of mass [kg m^2]: a number, three principal moments or a 3 x 3 matrix",
    )
    position: Vector = Field(default=[0.0, 0.0, 0.0], description="of the centre of mass [m]")
    orientation: Orientation = Field(
        default=[1.0, 0.0, 0.0, 0.0], description="quaternion [w, x, y, z], or { roll_deg, pitch_deg, yaw_deg }"
    )
    velocity: Vector = Field(default=[0.0, 0.0, 0.0], description="[m/s]")
    angular_velocity: Vector = Field(default=[0.0, 0.0, 0.0], description="[rad/s]")
    collides_with: list[str] | None = Field(
        default=None, description="names of the bodies and planes that it may touch; default: all"
    )


class GroundTable(SurfaceTable):
    """The floor: the horizontal plane called ground."""

    height: Finite = Field(default=0.0, description="z of the surface [m]")


class PlaneTable(SurfaceTable):
    """A static wall: everything behind the plane is solid."""

    name: Identifier = Field(description="how pairs and settings refer to it")
    normal: Vector = Field(description="out of the wall, any length but 0")
    point: Vector | None = Field(default=None, description="any point of the plane [m]")
    offset: Finite | None = Field(
        default=None, description="distance of the plane from the origin along the normal [m]"
    )


class ContactTable(Table):
    """The law of contacts for which no surface and no pair states anything else."""

    friction: NonNegative = Field(default=0.5, description="Coulomb's coefficient")
    restitution: Share = Field(default=0.0, description="share of the speed that is left after a bounce")
    torsion: NonNegative = Field(default=0.0, description="a radius [m]")
    rolling: NonNegative = Field(default=0.0, description="a radius [m]")
    frequency: NonNegative = Field(default=0.0, description="of soft contacts [Hz]; 0: contacts are rigid")
    damping: NonNegative | None = Field(default=None, description="damping ratio of soft contacts; default 1")


class PairTable(SurfaceTable):
    """What holds between two surfaces, whatever they state."""

    between: Annotated[list[str], Field(min_length=2, max_length=2)] = Field(description="two names: [body, other]")
    collide: bool = Field(default=True, description="false: the two pass through each other")
    frequency: NonNegative | None = Field(default=None, description="of a soft contact [Hz]; 0: rigid")
    damping: NonNegative | None = Field(default=None, description="damping ratio of the soft contact")
