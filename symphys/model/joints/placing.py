"""Joints of a world that is built in Python: bodies by name, and the frames where these were placed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from symphys.errors import SymphysError
from symphys.model.body import Body
from symphys.model.joints import JOINTS
from symphys.model.joints.frames import WORLD, Pose, check_meeting, placed_joint_frames, pose
from symphys.model.joints.joint import Joint, JointFrame
from symphys.model.joints.kind import Kind
from symphys.model.joints.specs import JointSpec, MovingJoint
from symphys.model.joints.start import State, moved_to_start, spanning_tree, unmoved
from symphys.model.shapes import UPRIGHT
from symphys.records import dataclass
from symphys.suggest import hint, quote
from symphys.types import Array

ORIGIN = (0.0, 0.0, 0.0)
REST = {"position": ORIGIN, "orientation": UPRIGHT, "velocity": ORIGIN, "angular_velocity": ORIGIN}
"""Where bodies begin that do not say so."""


@dataclass(frozen=True)
class PlacedJoint:
    """A joint between bodies by name, with its frames; see ``NamedJoint``."""

    name: str
    kind: Kind
    first: str
    second: str | None
    frames: tuple[JointFrame, JointFrame]
    frequency: float = 0.0
    start: tuple[float, ...] = ()


def placed_joints(
    specs: Sequence[JointSpec], names: Sequence[str], state: Mapping[str, Array]
) -> tuple[tuple[Joint, ...], State]:
    """Joints with frames, and the state with every joint at its ``start``.

    Args:
        specs: as they are described.
        names: of the bodies, in their order.
        state: of every body, by names such as ``ball.position``; all coordinates are 0 there.

    Raises:
        SymphysError: names the joint and what would be valid.
    """
    for spec in specs:
        if not isinstance(spec, JointSpec):
            text = f"must be one of {', '.join(sorted(each.__name__ for each in JOINTS.values()))}"
            raise SymphysError(
                f"joints: {text}, not {type(spec).__name__}; those with frames go into World(joints=...)"
            )
    if WORLD in names:
        raise SymphysError(f'a body is called "{WORLD}", which joints call what stands still; give it another name')
    placed = [_placed(spec, names, state) for spec in specs]
    tree = spanning_tree(placed)
    for joint in placed:
        reason = unmoved(joint, tree) if joint.start else ""
        if reason:
            text = f"this joint {reason}, so it begins where the other joints put it; leave start out"
            raise _refused(joint.name, text)
    places = {name: index for index, name in enumerate(names)}
    joints = tuple(_joint(spec, joint, places) for spec, joint in zip(specs, placed, strict=True))
    return joints, moved_to_start(placed, state)


def _placed(spec: JointSpec, names: Sequence[str], state: Mapping[str, Array]) -> PlacedJoint:
    """A joint with its frames as the bodies lie."""
    _check_between(spec, names)
    second, first = spec.between
    try:
        poses = [pose(name, state) for name in (first, second)]
        frames = placed_joint_frames(poses, _points(spec, poses), spec.frame_axes)
        start: tuple[float, ...] = ()
        if isinstance(spec, MovingJoint):
            spec.check_acting()
            start = spec.start_coordinates
    except ValueError as fault:
        raise _refused(spec.name, str(fault)) from None
    other = None if second == WORLD else second
    return PlacedJoint(spec.name, spec.kind, first, other, frames, spec.frequency, start)


def _joint(spec: JointSpec, placed: PlacedJoint, places: Mapping[str, int]) -> Joint:
    """The joint of a world; ``places``: the indices of bodies."""
    sides = places[placed.first], None if placed.second is None else places[placed.second]
    soft = {"frequency": spec.frequency, "damping": spec.damping}
    if not isinstance(spec, MovingJoint):
        return Joint(spec.name, spec.kind, *sides, placed.frames, **soft)
    found = Joint(spec.name, spec.kind, *sides, placed.frames, spec.motor, spec.bounds, spec.spring, **soft)
    return replace(found, armature=spec.armature, friction=spec.friction, start=placed.start)


def _check_between(spec: JointSpec, names: Sequence[str]) -> None:
    """Two bodies, or the world and a body."""
    if len(spec.between) != 2 or isinstance(spec.between, str):
        raise _refused(spec.name, f'between must name two bodies, or "{WORLD}" and a body, not {spec.between}')
    a, b = spec.between
    for name in spec.between:
        if name not in names and name != WORLD:
            raise _refused(spec.name, f"no body is called {quote(name)}; {hint(name, [WORLD, *names])}")
    if a == b:
        raise _refused(spec.name, "between names the same body twice" if a != WORLD else "between needs a body")
    if b == WORLD:
        text = f'between: the second must be a body, which moves against the first: ("{WORLD}", "{a}")'
        raise _refused(spec.name, text)


def _points(spec: JointSpec, poses: Sequence[Pose]) -> list[Array]:
    """(3,) on the first and on the second side, each in its own frame; ValueError for places that are none."""
    if spec.anchors is not None:
        if spec.point is not None:
            raise ValueError("anchors are given and point too; leave one out")
        anchors = [_three("anchors", anchor) for anchor in reversed(spec.anchors)]
        try:
            check_meeting(poses, anchors)
        except ValueError as fault:
            raise ValueError(f"its anchors {fault}") from None
        return anchors
    if spec.point is None and not spec.anywhere:
        raise ValueError("point is required: where the joint is [m], world coordinates; or give anchors")
    point = poses[0].position if spec.point is None else _three("point", spec.point)
    return [pose.to_body(point) for pose in poses]


def _three(key: str, given: object) -> Array:
    """(3,) finite numbers."""
    value = np.asarray(given, float)
    if value.shape != (3,) or not np.isfinite(value).all():
        raise ValueError(f"{key} must be three numbers [m], not {given}")
    return value


def _refused(name: str, text: str) -> SymphysError:
    """The error about a joint."""
    return SymphysError(f"joint {quote(name)}: {text}")


def jointed(bodies: tuple[Body, ...], joints: Sequence[JointSpec]) -> tuple[tuple[Body, ...], tuple[Joint, ...]]:
    """Bodies where they begin, with every joint at its ``start``, and joints with frames.

    Raises:
        SymphysError: names the joint and what would be valid.
    """
    state = {f"{b.name}.{key}": np.array(b.start.get(key, rest), float) for b in bodies for key, rest in REST.items()}
    made, moved = placed_joints(joints, [body.name for body in bodies], state)
    return tuple(replace(body, start=begins(body, moved)) for body in bodies), made


def begins(body: Body, state: Mapping[str, Array]) -> dict[str, tuple[float, ...]]:
    """The start of a body in a state; what it did not say and is still at rest stays unsaid."""
    found = {key: tuple(state[f"{body.name}.{key}"].tolist()) for key in REST}
    return {key: value for key, value in found.items() if key in body.start or value != REST[key]}
