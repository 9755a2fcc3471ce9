"""The [[joint]], [[coupling]] and [[site]] tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite

import casadi as ca
import numpy as np

from symphys.maths import rotation
from symphys.model.body import SiteMotor
from symphys.model.gimbal import Screw, locks
from symphys.model.joints import (
    JOINTS,
    JointFrame,
    JointSpec,
    Kind,
    Limits,
    Motor,
    Spring,
    kinematic_trees,
)
from symphys.model.joints.coupling import DEGREE, CouplingSpec
from symphys.model.joints.frames import WORLD, Pose, check_meeting, placed_joint_frames, pose
from symphys.model.joints.motor import MOTORS
from symphys.model.scalar import is_zero
from symphys.model.world import World
from symphys.problem.parametric.joints import OWN, ParametricJoint
from symphys.problem.parametric.parts import ParametricSite
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.reading.messages import wanted
from symphys.problem.schema.joints import CouplingTable, JointTable, MotorTable, SiteTable
from symphys.problem.tables.bodies import read_orientation
from symphys.records import dataclass
from symphys.suggest import hint, quote
from symphys.types import Array


def read_joint_frames(
    place: Place, table: JointTable, spec: JointSpec, word: str, initial: Mapping[str, Array], faults: Faults
) -> tuple[JointFrame, JointFrame]:
    """Return the frames of the table's second body, whose coordinates count, then of the first.

    Args:
        place: of the table.
        table: what it holds together is known.
        spec: the same joint, of its kind.
        word: the key of the table of its kind.
        initial: the state of bodies at the start; see ``Problem.initial``.
        faults: gets anchors that do not meet, axes that are none.
    """
    poses = [pose(name, initial) for name in reversed(table.between)]
    try:
        axes = spec.frame_axes
    except ValueError as fault:
        faults.add((*place, word, spec.own_fields()[0].name), str(fault))
        axes = np.eye(3)
    return placed_joint_frames(poses, read_points(place, table, spec, poses, faults), axes)


def read_points(place: Place, table: JointTable, spec: JointSpec, poses: Sequence[Pose], faults: Faults) -> list[Array]:
    """(3,) on each side, in its own frame."""
    if table.anchors is not None:
        if table.point is not None:
            faults.add((*place, "point"), "anchors are given too; leave one out")
        anchors = [np.array(anchor) for anchor in reversed(table.anchors)]
        try:
            check_meeting(poses, anchors)
        except ValueError as fault:
            faults.add((*place, "anchors"), str(fault))
        return anchors
    if table.point is None and not spec.anywhere:
        text = "this key is required: where the joint is at the start [m], world coordinates; or give anchors"
        faults.add((*place, "point"), text)
    point = poses[0].position if table.point is None else np.array(table.point)
    return [pose.to_body(point) for pose in poses]


def read_joints(
    tables: Sequence[JointTable],
    bodies: Sequence[str],
    initial: Mapping[str, Array],
    faults: Faults,
    massless: Sequence[str] = (),
) -> tuple[ParametricJoint, ...]:
    """The [[joint]] tables; notes what is impossible, and loops in which nothing can move.

    Args:
        tables: as they are in the file.
        bodies: the names of the bodies.
        initial: their state at the start; see ``Problem.initial``.
        faults: gets what is wrong.
        massless: those of the bodies that have no mass.
    """
    found = [JointReader(index, table, bodies, initial, faults).read() for index, table in enumerate(tables)]
    check_loops(found, faults)
    check_frames(found, massless, faults)
    return tuple(joint for joint in found if joint)


def check_frames(joints: Sequence[ParametricJoint | None], massless: Sequence[str], faults: Faults) -> None:
    """A body without mass must be between rigid joints: what hangs on it gives it inertia."""
    for name in massless:
        held = [joint for joint in joints if joint and name in (joint.first, joint.second)]
        if len(held) < 2 or any(joint.frequency for joint in held):
            text = f"{name} has mass 0, so it must be between two rigid joints, which hold it to bodies with mass"
            faults.add(("joint",), text)
            return
    for tree in _trees(joints, massless):
        chain = tree.joints
        if locks(tree.screws, tree.paths):
            names = ", ".join(joint.name for joint in chain)
            text = (
                f"{names}, with frames of mass 0 between them, can come to a pose in which their axes depend on each "
                f"other (gimbal lock), where no inertia answers; use one ball joint, give {chain[0].name} or "
                f"{chain[-1].name} an `armature`, or keep the joints between them away from it by `limits`"
            )
            faults.add(("joint", list(joints).index(chain[0])), text)


@dataclass
class _Tree:
    """Joints that frames without mass connect, from one body with mass, or the world, to all others.

    Attributes:
        joints: the first is the one of that body.
        screws: of all joints, in their order, at the pose in which all coordinates are 0.
        paths: for each other body, the indices of the screws between.
    """

    joints: list[ParametricJoint]
    screws: list[Screw]
    paths: list[list[int]]


def _trees(joints: Sequence[ParametricJoint | None], massless: Sequence[str]) -> Iterator[_Tree]:
    """The joints of all frames without mass; left out: joints that close a ring of frames."""
    rigid = [joint for joint in joints if joint]
    held = {name: [joint for joint in rigid if name in (joint.first, joint.second)] for name in massless}
    seen: set[str] = set()

    def grow(tree: _Tree, joint: ParametricJoint, body: str, pose: Array, path: list[int]) -> None:
        before = len(tree.screws)
        pose = _crossed(joint, body, pose, tree.screws)
        path = [*path, *range(before, len(tree.screws))]
        tree.joints.append(joint)
        if (frame := _other(joint, body)) not in held:
            tree.paths.append(path)
            return
        seen.add(frame)
        for more in held[frame]:
            if more is not joint and _other(more, frame) not in seen:
                grow(tree, more, frame, pose, path)

    for joint in rigid:
        for body in (joint.first, joint.second or WORLD):
            frame = _other(joint, body)
            if body not in held and frame in held and frame not in seen:
                grow(tree := _Tree([], [], []), joint, body, np.eye(4), [])
                yield tree


def _other(joint: ParametricJoint, body: str) -> str:
    return str(joint.second or WORLD) if body == joint.first else joint.first


def _crossed(joint: ParametricJoint, body: str | None, pose: Array, screws: list[Screw]) -> Array:
    """The pose (4, 4) of the body on the other side of a joint from ``body`` at ``pose``, all coordinates 0."""
    first, second = (_pose(frame) for frame in joint.frames)
    here, there = (first, second) if body == joint.first else (second, first)
    frame: Array = pose @ here
    low, high = (_bound(joint.limits.lower, -np.inf), _bound(joint.limits.upper, np.inf))
    low, high = (-high, -low) if body == joint.first else (low, high)
    carried = not is_zero(joint.armature)
    moves = [(each.axis, each.turns, each.lead) for each in joint.kind.coordinates]
    moves = moves or [(k, True, 0.0) for k in range(joint.kind.free)]
    for k, turns, lead in moves if body == joint.first else reversed(moves):
        screws.append(Screw(frame[:3, k], frame[:3, 3] if turns else None, low, high, carried, float(lead)))
    return np.asarray(frame @ np.linalg.inv(there), float)


def _pose(frame: JointFrame) -> Array:
    found, q = np.eye(4), np.array(frame.orientation, float)
    found[:3, :3] = rotation.matrix(ca.DM(q / np.linalg.norm(q)))
    found[:3, 3] = np.array(frame.point, float)
    return found


def _bound(limit: float | None, none: float) -> float:
    return none if limit is None else float(limit)


def check_loops(joints: Sequence[ParametricJoint | None], faults: Faults) -> None:
    """Rigid fixed joints must not close a loop: what each of them carries would not be determined."""
    whole: dict[str, str] = {}

    def root(name: str) -> str:
        while name in whole:
            name = whole[name]
        return name

    for index, joint in enumerate(joints):
        if joint is None or joint.kind.free or joint.frequency:
            continue
        a, b = root(joint.first), root(joint.second or WORLD)
        if a == b:
            text = (
                f"{joint.second or WORLD} and {joint.first} are held together by other fixed joints already; leave "
                "this one out, or let one of them give way with a frequency"
            )
            faults.add(("joint", index, "fixed"), text)
        else:
            whole[a] = b


class JointReader:
    """Reads one table; every fault is noted below its place."""

    def __init__(
        self, index: int, table: JointTable, bodies: Sequence[str], initial: Mapping[str, Array], faults: Faults
    ) -> None:
        """Keep what all steps need."""
        self.place: Place = ("joint", index)
        self.table, self.bodies, self.initial, self.faults = table, bodies, initial, faults

    def add(self, key: str, message: str) -> None:
        """Note a fault of one key, or of a key of a table within."""
        self.faults.add((*self.place, *key.split(".")), message)

    def read(self) -> ParametricJoint | None:
        """The joint; None if it is unclear what it holds together, or how."""
        before, table = len(self.faults.issues), self.table
        self.check_between()
        word = self.kind()
        if len(self.faults.issues) > before or word is None:
            return None
        own = {each.name: getattr(getattr(table, word), each.name) for each in JOINTS[word].own_fields()}
        spec = JOINTS[word](table.name, tuple(table.between), **own)
        kind = spec.kind
        self.check_acting(kind)
        self.check_damping()
        second, first = (None if name == WORLD else name for name in table.between)
        assert first is not None
        limits = self.limits(kind)
        return ParametricJoint(
            name=table.name,
            kind=kind,
            first=first,
            second=second,
            frames=read_joint_frames(self.place, table, spec, word, self.initial, self.faults),
            motor=self.motor(table.motor),
            limits=limits,
            spring=None if table.spring is None else Spring(**dict(table.spring)),
            frequency=table.frequency,
            damping=1.0 if table.damping is None else table.damping,
            collide=table.collide,
            start=self.start(kind, limits),
            **{key: getattr(table, key) for key in OWN},
        )

    def check_between(self) -> None:
        """Two bodies, or the world and a body."""
        a, b = self.table.between
        if WORLD in self.bodies:
            text = f'a body is called "{WORLD}", which here means what stands still; give it another name'
            self.add("between", text)
            return
        if a == b:
            self.add("between", "names the same body twice" if a != WORLD else "needs a body")
        elif b == WORLD:
            self.add("between", f'the second must be a body, which moves against the first: ["{WORLD}", "{a}"]')
        for name in dict.fromkeys(self.table.between):
            if name not in self.bodies and name != WORLD:
                known = [WORLD, *self.bodies]
                self.add("between", f"no body is called {quote(name)}; {hint(name, known)}")

    def kind(self) -> str | None:
        """Return the name of the kind that is given."""
        given = [name for name in JOINTS if getattr(self.table, name) is not None]
        if len(given) == 1:
            return given[0]
        examples = ", ".join(f"{name} = {each.example}" for name, each in JOINTS.items())
        self.faults.add(self.place, f"{wanted(given)} one of {examples}")
        return None

    def check_acting(self, kind: Kind) -> None:
        """Note what acts along coordinates of a joint without any."""
        if kind.coordinates:
            return
        for key in ("motor", "limits", "limits_deg", "start", "start_deg", "spring", "friction"):
            if getattr(self.table, key):
                which = f"a {kind.name} joint has no coordinate along which it could act"
                self.add(key, f"{which}; leave it out, or take a hinge, a slider or a universal joint")

    def check_damping(self) -> None:
        """Damping without softness would have no effect."""
        if self.table.damping is not None and not self.table.frequency:
            self.add("damping", "has no effect on a rigid joint; give frequency too, or damping of a spring")

    def motor(self, table: MotorTable | None) -> Motor | None:
        """The one that is given."""
        if table is None:
            return None
        given = [word for word in MOTORS if getattr(table, word) is not None]
        if len(given) != 1:
            examples = ", ".join(f"{word} = {motor.example}" for word, motor in MOTORS.items())
            self.add("motor", f"{wanted(given)} one of {examples}")
            return None
        numbers = dict(getattr(table, given[0])).items()
        return MOTORS[given[0]](**{key: tuple(value) if isinstance(value, list) else value for key, value in numbers})

    def limits(self, kind: Kind) -> Limits:
        """Read the limits in rad or m."""
        table = self.table
        if table.limits is not None and table.limits_deg is not None:
            self.add("limits_deg", "limits are given too; leave one out")
        if table.limits_deg is not None and not kind.turning:
            self.add("limits_deg", f"a {kind.name} has no angle; give limits [m]")
        degrees = [] if table.limits_deg is None else np.deg2rad(table.limits_deg).tolist()
        ends = degrees if table.limits is None else table.limits
        low, high = (end if isfinite(end) else None for end in ends or (np.inf, np.inf))
        return Limits(low, high)

    def start(self, kind: Kind, limits: Limits) -> tuple[float, ...]:
        """Return the start in rad or m, within the limits; empty if none is given."""
        table = self.table
        key, given = ("start", table.start) if table.start_deg is None else ("start_deg", table.start_deg)
        if given is None or not kind.coordinates:
            return ()
        count = len(kind.coordinates)
        if table.start is not None and table.start_deg is not None:
            self.add("start_deg", "start is given too; leave one out")
        if key == "start_deg" and not kind.turning:
            self.add(key, f"a {kind.name} has no angle; give start [m]")
        if len(given) != count:
            self.add(key, f"a {kind.name} has {count} coordinate{'s' * (count > 1)}, but {len(given)} are given")
        values = tuple(np.deg2rad(given).tolist() if key == "start_deg" else given)
        for value, written in zip(values, given, strict=True):
            if (limits.lower is not None and value < limits.lower) or (
                limits.upper is not None and value > limits.upper
            ):
                self.add(key, f"{written:g} is beyond the limits of this joint")
        return values


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
        motor = None if table.motor is None else read_site_motor(table, index, faults)
        found.append(ParametricSite(table.name, body, (x, y, z), tuple(orientation.tolist()), motor))
    return tuple(found)


def read_site_motor(table: SiteTable, index: int, faults: Faults) -> SiteMotor:
    """The motor of a site; notes one that does nothing, or acts on the world."""
    assert table.motor is not None
    given, place = table.motor, ("site", index, "motor")
    ends = None if given.command_range is None else tuple(given.command_range)
    motor = SiteMotor(tuple(given.force), tuple(given.torque), ends)
    if table.body == WORLD:
        faults.add(place, "a motor acts on a body, and this site belongs to the world")
    if not any((*motor.force, *motor.torque)):
        faults.add(place, f"does nothing: give it a force [N] or a torque [N m], as in {SiteMotor.example}")
    return motor


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
