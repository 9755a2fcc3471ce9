"""Names <-> columns of the state vector x: the only place that knows indices.

For each body: position (3) [m], orientation (4) [-] quaternion w x y z, velocity (3) [m/s] and angular_velocity (3)
[rad/s] at t_k, world frame, and the force (3) [N] and torque (3) [N m] with which constraints act on it persistently.
For each pair: force (3) [N] on its first body, and torque (3) [N m] if its law resists spinning. For each joint: if
it closes a loop or is soft lock, the forces and torques of what it locks; if it turns unwrapped [rad], its angles to
within half a turn, which say which of the angles that poses allow is meant; and a number per coordinate for its motor,
lower and upper limit, spring and dry friction; also what the last command gave, where the motor gives more than that.
For each coupling what it gives. Last ``lag`` [s].

The velocities are the true ones at t_k: 0 at rest. The step needs them without the persistent forces of the last
half step: v - lag force / m. ``lag`` is 0 at the start and dt/2 after the first step, so that no step is special.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca

from symphys.model.joints import tree_joints
from symphys.model.joints.joint import DRIVE
from symphys.model.world import NOTHING, World

BODY_FIELDS = (
    ("position", 3),
    ("orientation", 4),
    ("velocity", 3),
    ("angular_velocity", 3),
    ("reaction_force", 3),
    ("reaction_torque", 3),
)
COUPLED = "lock"
"""What a coupling gives along the coordinate that follows."""
WORKING = ("motor", "spring", "friction")
"""The parts of a joint whose forces do work along its coordinates; limits are counted with contacts."""
INPUT_FIELDS = ("force", "torque")
GIVEN = ("position", "orientation", "velocity", "angular_velocity")
"""The fields of a body that an initial state may give."""


class Layout:
    """The places of named quantities in x."""

    def __init__(self, world: World) -> None:
        """Lay out the bodies, then the pairs, the joints and the lag."""
        self._slices: dict[str, slice] = {}
        self.size = 0
        for body in world.bodies:
            for name, length in BODY_FIELDS:
                self._add(f"{body.name}.{name}", length)
        for pair in world.pairs:
            self._add(f"{pair.name}.force", 3)
            if pair.law.spins:
                self._add(f"{pair.name}.torque", 3)
        exact = tree_joints(world.joints)
        for k, joint in enumerate(world.joints):
            if k not in exact:
                self._add(f"{joint.name}.lock", joint.locked)
            if joint.unwrapped is not None:
                self._add(joint.unwrapped, len(joint.kind.coordinates))
            for part in joint.acting:
                self._add(f"{joint.name}.{part}", len(joint.kind.coordinates))
            if joint.drive == DRIVE:
                self._add(f"{joint.name}.{DRIVE}", len(joint.kind.coordinates))
        for coupling in world.couplings:
            self._add(f"{coupling.name}.{COUPLED}", 1)
        self._add("lag", 1)

    def _add(self, name: str, length: int) -> None:
        if name in self._slices:
            raise ValueError(f"two parts of the world are called {name!r}")
        self._slices[name] = slice(self.size, self.size + length)
        self.size += length

    def __getitem__(self, name: str) -> slice:
        """The columns of ``name``, for instance ``ball.velocity``."""
        try:
            return self._slices[name]
        except KeyError:
            raise KeyError(f"the state has no {name!r}; it has {', '.join(self._slices)}") from None

    def __contains__(self, name: object) -> bool:
        """Whether the state has a quantity of this name."""
        return name in self._slices

    def names(self) -> tuple[str, ...]:
        """Return all names, in the order of the columns."""
        return tuple(self._slices)

    def owner(self, column: int) -> str:
        """The name of the quantity that has this column."""
        return next(name for name, part in self._slices.items() if part.start <= column < part.stop)

    def pack(self, values: Mapping[str, Any]) -> Any:
        """x as a casadi column, from a value for every name."""
        return ca.vertcat(*(values[name] for name in self._slices))


def force_names(world: World) -> list[tuple[str, int]]:
    """Return what a state calls the forces that do work along coordinates of joints, and their sizes."""
    coordinates = [(joint, len(joint.kind.coordinates)) for joint in world.joints]
    return [(f"{joint.name}.{part}", k) for joint, k in coordinates for part in WORKING if part in joint.acting]


def initial_state(world: World, values: Mapping[str, Any] = NOTHING) -> Any:
    """x at t = 0 (a casadi column) from positions, orientations and velocities by name.

    ``values`` maps names such as ``ball.velocity`` to numbers or casadi expressions; velocities are the true ones. What
    is not named is as the bodies' own ``start`` has it, else zero. Angles of joints are those nearest to
    ``hinge.unwrapped`` [rad] that fit the poses; by itself that is the joint's ``start``.

    Example:
        >>> from symphys.model import Body, Layout, initial_state, make_world
        >>> world = make_world([Body.ball("ball", radius=0.1, mass=0.5, position=(0, 0, 1))])
        >>> x = initial_state(world, {"ball.velocity": [3, 0, 2]})
        >>> x[Layout(world)["ball.velocity"]]
        DM([3, 0, 2])
    """
    layout = Layout(world)
    near = {
        joint.unwrapped: joint.start or [0.0] * len(joint.kind.coordinates)
        for joint in world.joints
        if joint.unwrapped is not None
    }
    given = near.keys() | {f"{body.name}.{field}" for body in world.bodies for field in GIVEN}
    for name in values:
        if name not in given:
            raise KeyError(f"an initial state cannot set {name!r}; it can set {', '.join(sorted(given))}")
    values = {**world.start, **near, **values}
    filled: dict[str, Any] = {}
    for name in layout.names():
        part = layout[name]
        zero = [1.0, 0.0, 0.0, 0.0] if name.endswith(".orientation") else [0.0] * (part.stop - part.start)
        filled[name] = ca.vertcat(values.get(name, zero))
    return layout.pack(filled)


def input_sizes(world: World) -> dict[str, int]:
    """Map the inputs of a world to their sizes: forces and torques on bodies, commands of joints and of sites."""
    forces = {f"{body.name}.{field}": 3 for body in world.bodies for field in INPUT_FIELDS}
    commands = {f"{joint.name}.command": len(joint.kind.coordinates) for joint in world.joints if joint.driven}
    commands |= {f"{site.name}.command": 1 for site in world.sites if site.motor is not None}
    return forces | commands | {name: 1 for name, _ in world.scheduled}


def input_names(world: World) -> list[str]:
    """The names of ``input_sizes``."""
    return list(input_sizes(world))


def input_size(world: World, name: str) -> int:
    """Return the size of an input; KeyError for an unknown name."""
    sizes = input_sizes(world)
    if name not in sizes:
        raise KeyError(f"no input is called {name!r}; there are {', '.join(sorted(sizes))}")
    return sizes[name]


def input_columns(world: World, inputs: Sequence[str]) -> dict[str, slice]:
    """Map inputs to their columns of u, which stacks them; KeyError for an unknown name."""
    columns, start, sizes = dict[str, slice](), 0, input_sizes(world)
    for name in inputs:
        stop = start + (sizes[name] if name in sizes else input_size(world, name))
        columns[name], start = slice(start, stop), stop
    return columns


def input_symbols(world: World, inputs: Sequence[str]) -> Any:
    """U as symbols (SX); what is scheduled are those of the world."""
    scheduled, sizes = dict(world.scheduled), input_sizes(world)
    sizes |= {name: input_size(world, name) for name in inputs if name not in sizes}
    return ca.vertcat(ca.SX(0, 1), *(scheduled.get(name, ca.SX.sym(name, sizes[name])) for name in inputs))


def inputs_size(world: World, inputs: Sequence[str]) -> int:
    """Return the size of u, which stacks these inputs."""
    return max((part.stop for part in input_columns(world, inputs).values()), default=0)
