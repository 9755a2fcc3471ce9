"""Differences between a model for MuJoCo and the world that it is written from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Literal

from symphys.export.folder import ExportError
from symphys.export.mjcf_bodies import MAX_JOINT_GAP, StartState, loose_frames, nesting_joints
from symphys.export.mjcf_joints import expressible_loop, joint_equalities
from symphys.export.mjcf_surfaces import deviation, normal_of, window
from symphys.model.heightfield import Heightfield
from symphys.model.joints import Servo, VelocityMotor
from symphys.model.scalar import is_zero
from symphys.model.shapes import Terrain
from symphys.records import dataclass

MAX_LISTED = 5
"""Largest number of names in a message."""
Kind = Literal["approximated", "left out", "refused", "measured"]


@dataclass(frozen=True)
class Departure:
    """A part of a world that MJCF has no exact counterpart for.

    Attributes:
        kind: ``approximated`` by the nearest element; ``left out``, which is refused unless approximations are allowed;
            ``refused``; ``measured`` by a trial.
        what: names of joints, contacts, surfaces or sensors.
        how: the replacement, or a remedy.
    """

    kind: Kind
    what: tuple[str, ...]
    how: str

    def __str__(self) -> str:
        """Return kind, names and explanation in a line."""
        return f"{self.kind}: {listed(self.what)}: {self.how}"


def listed(names: Sequence[str]) -> str:
    """Join the first few names."""
    more = len(names) - MAX_LISTED
    return ", ".join(names[:MAX_LISTED]) + (f" and {more} more" if more > 0 else "")


def require_expressible(departures: Iterable[Departure], name: str, approximate: bool) -> None:
    """Raise ExportError if anything has no counterpart, with all of these and their remedies."""
    refused = [each for each in departures if each.kind == "refused" or (each.kind == "left out" and not approximate)]
    lines = [f"{name}: MJCF cannot say this: {listed(each.what)}: {each.how}" for each in refused]
    if any(each.kind == "left out" for each in refused):
        lines.append("with --approximate, or approximate=True, the model is written without it")
    if lines:
        raise ExportError("\n".join(lines))


def departures(start: StartState) -> list[Departure]:
    """Collect the departures of a world at its start, the gravest first; those of sensors are not among them."""
    rounded = [body.name for body in start.world.bodies if any("edge" in shape.sizes for shape in body.shapes)]
    edges = Departure("approximated", tuple(rounded), "a box with round edges, which are sharp in MuJoCo")
    found = [
        edges,
        *joint_departures(start),
        *contact_departures(start),
        *terrain_departures(start),
        *soft_departures(start),
    ]
    order = ("refused", "left out", "approximated")
    return sorted((each for each in found if each.what), key=lambda each: order.index(each.kind))


def shorter_step(dt: float, count: int) -> Iterator[Departure]:
    """Yield the departure of a time step that is cut into parts."""
    if count > 1:
        text = (
            f"time step {dt / count:g} s instead of {dt:g} s, because MuJoCo is unstable with these motors, springs or "
            f"contacts at {dt:g} s"
        )
        yield Departure("approximated", ("time step",), text)


def joint_departures(start: StartState) -> Iterator[Departure]:
    """Yield the departures of joints and motors."""
    world, trees = start.world, nesting_joints(start.world)
    apart = [world.joints[k].name for k in sorted(trees) if start.gap(world.joints[k]) > MAX_JOINT_GAP]
    text = "a joint that does not fit its bodies at the start; move them until its frames meet"
    yield Departure("refused", tuple(apart), text)
    frames = tuple(world.bodies[k].name for k in loose_frames(world))
    yield Departure("refused", frames, "a frame without mass that is not between two joints of one chain")
    others = [joint for k, joint in enumerate(world.joints) if k not in trees]
    soft = [joint.name for joint in others if joint.soft and not expressible_loop(world, joint)]
    text = "a compliant joint, whose law differs from MuJoCo's; leave out its frequency"
    yield Departure("left out", tuple(soft), text)
    loops = [joint.name for joint in others if not joint.soft and not expressible_loop(world, joint)]
    text = "a joint that closes a loop, which only ball, hinge and fixed joints between bodies with mass do there"
    yield Departure("left out", tuple(loops), text)
    driven = [joint.name for joint in world.joints if isinstance(joint.motor, Servo | VelocityMotor)]
    text = "a motor that reaches its velocity within a step, as an actuator of finite gain: it sags under load"
    yield Departure("approximated", tuple(driven), text)


def contact_departures(start: StartState) -> Iterator[Departure]:
    """Yield the departures of contact laws."""
    contacts = {pair.name.partition(":")[0]: pair.law for pair in start.world.pairs}
    bouncing = [name for name, law in contacts.items() if not law.soft and not is_zero(law.restitution)]
    text = "restitution, which MuJoCo does not have; give the surfaces restitution 0"
    yield Departure("left out", tuple(bouncing), text)
    rubbing: dict[str, dict[str, None]] = {}
    for pair in start.world.pairs:
        friction = pair.law.mujoco_friction(normal_of(start.world, (pair.first, pair.second)))
        rubbing.setdefault(friction.departure, {})[pair.name.partition(":")[0]] = None
    for text, names in rubbing.items():
        yield Departure("left out", tuple(names) if text else (), text)
    soft = [name for name, law in contacts.items() if law.soft]
    text = "a contact that gives way, with its frequency by MuJoCo's estimate of the mass behind it"
    yield Departure("approximated", tuple(soft), text)


def terrain_departures(start: StartState) -> Iterator[Departure]:
    """Yield the departures of terrain: MuJoCo's height fields consist of triangles, and end."""
    for static in start.world.statics:
        if isinstance(static, Terrain):
            grid = window(start, static)
            off = f"triangles on the grid, off by at most {1000 * deviation(static, grid):.3g} mm"
            if isinstance(static.height, Heightfield):
                yield Departure("approximated", (static.name,), f"terrain as {off}; it ends at the edge of the grid")
            else:
                x, y = (
                    (at, at + step * (n - 1)) for at, step, n in zip(grid.origin, grid.spacing, grid.count, strict=True)
                )
                area = f"x from {x[0]:g} to {x[1]:g} m, y from {y[0]:g} to {y[1]:g} m"
                yield Departure("left out", (static.name,), f"terrain beyond {area}; there as {off}; take a grid")


def soft_departures(start: StartState) -> Iterator[Departure]:
    """Yield the parts that are rigid here, and springs with dampers of default softness in MuJoCo."""
    world, trees = start.world, nesting_joints(start.world)
    if any(not pair.law.soft for pair in world.pairs):
        yield Departure("approximated", ("contacts",), "rigid here; springs and dampers there, of default softness")
    limited = [joint.name for joint in world.joints if {"lower", "upper"} & set(joint.acting)]
    yield Departure("approximated", tuple(limited), "limits that are rigid here and soft there")
    rubbing = [joint.name for joint in world.joints if "friction" in joint.acting]
    yield Departure("approximated", tuple(rubbing), "dry friction that holds still here and creeps there")
    closing = [joint for k, joint in enumerate(world.joints) if k not in trees and expressible_loop(world, joint)]
    loops = tuple(joint.name for joint in closing if not joint.soft)
    yield Departure("approximated", loops, "a rigid joint that closes a loop, as an equality constraint that gives way")
    soft = tuple(joint.name for joint in closing if joint.soft)
    text = "a compliant joint, as an equality constraint of the same frequency and damping ratio"
    yield Departure("approximated", soft, text)
    coupled = tuple(element.get("name", "") for element in joint_equalities(start.reference))
    yield Departure("approximated", coupled, "a coupling that is exact here and gives way there")
