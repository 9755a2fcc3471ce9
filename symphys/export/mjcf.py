"""Write a world and its start as MJCF, the model files of MuJoCo.

These parts are exact: bodies where the coordinates of joints are 0, with frames at the centres of mass; inertias; trees
of joints with the coordinates of this package; frames without mass, as several joints of one body; springs, dampers,
armature, torque motors, affine motors, gravity, time step, surfaces and sites. Geoms touch in explicit pairs only. The
start is the keyframe ``start``. Where coordinates 0 would open a loop, bodies are written at the start, and joints have
their coordinates there as ``ref``.

For other parts MuJoCo has different laws:

- Contacts, limits, dry friction, couplings and joints that close a loop are rigid here. In MuJoCo they are springs and
  dampers of default softness, which act over several steps. Friction of contacts is bounded by the same disc (elliptic
  cone); torsion and rolling share one ellipsoid with it.
- A servo here reaches the velocity clip(gain (command - angle), +-velocity) within a step unless that needs more than
  its torque. The nearest actuator is a position actuator with kp = gain kv and the same bound of force. It drives at
  gain (command - angle), without a bound on velocity, and needs a velocity error of torque / kv for its full torque, so
  that it sags under load. kv is 100 torque / velocity, or the largest at which the time step is stable
  (``steepness``).
- A velocity motor becomes a velocity actuator with the same kv.
- The time step is cut into parts where motors, springs or compliant contacts need it.
- A compliant contact has the same frequency and damping ratio, with MuJoCo's estimate of the mass behind it.
- Terrain is smooth here. In MuJoCo it consists of triangles, and ends at the edge of its grid.

Such actuators are stiff, hence the integrator ``implicitfast``. Parts without a counterpart are refused, or left out on
request: restitution, some compliant joints, some joints that close a loop, terrain without a grid. A ``Departure``
describes each difference, and the file begins with all of them. Variables, objectives and controllers are not part of a
model; commands are its ctrl, 0 at the start.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from math import inf
from types import MappingProxyType
from typing import Any
from xml.etree.ElementTree import Comment, Element, SubElement, indent, tostring

import casadi as ca
import numpy as np

from symphys.dynamics.motion import inertia_matrix
from symphys.dynamics.observation import named_sensors
from symphys.export.mjcf_bodies import NestedBody, StartState, links_of, nested_bodies, relative
from symphys.export.mjcf_departures import Departure, departures, require_expressible, shorter_step
from symphys.export.mjcf_joints import equalities, freedoms, names
from symphys.export.mjcf_surfaces import FRICTION_RATIO, PAIRS_ONLY, geoms, height_field, meshes, middle, pairs, text
from symphys.model.body import Body, Site, SiteMotor
from symphys.model.joints import AffineMotor, Joint, Motor, Servo, TorqueMotor, VelocityMotor, kinematic_trees
from symphys.model.scalar import is_zero
from symphys.model.shapes import Terrain
from symphys.model.world import World
from symphys.problem import Problem
from symphys.problem.model import Sensor
from symphys.records import dataclass
from symphys.types import Array

NUMBERS = r"(\[[^\[\]]*\])"
AT_A_POINT = {
    "framepos": re.compile(rf"(\w+)\.position \+ rotate\(\1\.orientation, {NUMBERS}\)"),
    "framelinvel": re.compile(
        rf"(\w+)\.velocity \+ cross\(\1\.angular_velocity, rotate\(\1\.orientation, {NUMBERS}\)\)"
    ),
}
"""Formulas of a point (3,) in a body's frame."""
ROTATED = re.compile(rf"rotate\({NUMBERS}, ([\w.]+)\)")
"""Formula of a vector in the axes to which the quaternion rotates those of the vector."""
SITE_TOLERANCE = 1e-9
"""Distance [m], or of quaternions, below which two sites are one."""


@dataclass
class SensorElements:
    """Sensors and sites of a model.

    Attributes:
        elements: of the sensors.
        sites: additional ones that sensors need.
        left_out: names of sensors without counterpart.
    """

    elements: list[Element] = field(default_factory=list)
    sites: list[Site] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)


def sensor_elements(world: World, sensors: Sequence[Sensor]) -> SensorElements:
    """Return all sensors with a counterpart; those of several formulas become several, with numbers."""
    found = SensorElements()
    for sensor in sensors:
        for k, formula in enumerate(sensor.formulas):
            name = sensor.name if len(sensor.formulas) == 1 else f"{sensor.name}_{k}"
            element = reading(world, name, formula.text.strip(), found.sites)
            if element is None:
                found.left_out.append(name)
            else:
                found.elements.append(element)
    return found


def reading(world: World, name: str, formula: str, sites: list[Site]) -> Element | None:
    """Return the sensor of a formula that is one name; None without one. Adds the site that it needs to ``sites``."""
    if formula == "time":
        return Element("clock", name=name)
    geared = {
        f"{joint.name}.torque / {joint.motor.gear}": joint.name
        for joint in world.joints
        if isinstance(joint.motor, AffineMotor) and len(joint.kind.coordinates) == 1
    }
    if formula in geared:
        return Element("actuatorfrc", name=name, actuator=geared[formula])
    bodies = {body.name: k for k, body in enumerate(world.bodies) if not body.massless}
    for kind, pattern in AT_A_POINT.items():
        if (found := pattern.fullmatch(formula)) and found[1] in bodies:
            site = site_at(world, sites, bodies[found[1]], position=json.loads(found[2]))
            return Element(kind, name=name, objtype="site", objname=site.name)
    turned = ROTATED.fullmatch(formula)
    return same_reading(world, name, turned[2] if turned else formula, turned[1] if turned else None, sites)


def same_reading(world: World, name: str, sensed: str, turn: str | None, sites: list[Site]) -> Element | None:
    """Return MuJoCo's counterpart of a sensor, after ``turn`` (4,) as text; None without one."""
    sensor = named_sensors(world).get(sensed)
    if sensor is None or sensor.kind.mjcf is None:
        return None
    word, at, owner = sensor.kind.mjcf.word, sensor.kind.mjcf.at, sensor.owner
    if at in ("axes", "frame"):
        mount = mount_of(world, owner)
        if mount is None:
            return None
        w, x, y, z = json.loads(turn or "[1, 0, 0, 0]")
        place = mount[1] if at == "frame" else None
        return Element(word, name=name, site=site_at(world, sites, mount[0], place, (w, -x, -y, -z)).name)
    if turn is not None or (isinstance(owner, Body) and owner.massless):
        return None
    if at == "joint":
        return Element(word, name=name, joint=owner.name) if len(owner.kind.coordinates) == 1 else None
    return Element(word, name=name, objtype=at, objname=owner.name)


def mount_of(world: World, owner: Any) -> tuple[int, Sequence[float]] | None:
    """Return the body whose axes a sensor has, and the sensor's point (3,) on it; None where MuJoCo has none.

    A joint's is the body that hangs on it: MuJoCo reads what a body's parent exerts on it.
    """
    if isinstance(owner, Joint):
        hanging = {link.joint for tree in kinematic_trees(world.joints) for link in tree.links if link.sign > 0}
        if [joint.name for joint in world.joints].index(owner.name) not in hanging:
            return None
        body, point = owner.first, owner.frames[0].point
    else:
        body, point = [each.name for each in world.bodies].index(owner.name), (0.0, 0.0, 0.0)
    return None if world.bodies[body].massless else (body, point)


def site_at(
    world: World,
    sites: list[Site],
    body: int,
    position: Sequence[float] | None = None,
    orientation: Sequence[float] | None = None,
) -> Site:
    """Return a site of a body at a position and orientation, of which either may be None: any.

    It is made and put into ``sites`` where there is none.
    """
    for site in (*world.sites, *sites):
        near = position is None or np.allclose(np.array(site.position, float), position, atol=SITE_TOLERANCE)
        alike = orientation is None or abs(np.dot(np.array(site.orientation, float), orientation)) > 1 - SITE_TOLERANCE
        if site.body == body and near and alike:
            return site
    name = f"{world.bodies[body].name}_sensor{len(sites) or ''}"
    sites.append(Site(name, body, position or (0.0, 0.0, 0.0), orientation or (1.0, 0.0, 0.0, 0.0)))
    return sites[-1]


def site_elements(sites: Sequence[Site], body: int | None) -> list[Element]:
    """Return the sites of a body in its frame; those of the world for None."""
    return [
        Element("site", name=site.name, pos=text(site.position), quat=text(site.orientation))
        for site in sites
        if site.body == body
    ]


Inertias = Mapping[tuple[str, int], float]
"""The inertia of each coordinate of the trees [kg m^2] or [kg], by the joint's name and the number there."""
WANTED_SPEED_ERROR, MAX_SPEED_ERROR = 0.01, 0.1
"""Velocity error at full torque, as a share of a motor's largest velocity: desired, and allowed."""
MAX_STEP_PHASE, MAX_STEP_PHASE_CONTACT = 1.0, 0.125
"""Largest h omega of a spring, and of a compliant contact: the damping of several adds up."""
MAX_PARTS = 50
"""Largest number of parts of a time step."""
UNBOUNDED = 1e10
"""Bound of a force or a command where one of two is missing, in the unit of either."""


def parts(start: StartState, found: Inertias, dt: float) -> int:
    """Return the number of parts into which a step of ``dt`` [s] is cut."""
    longest = min(_longest(start, found), default=inf)
    return max(1, min(MAX_PARTS, math.ceil(dt / longest - 1e-9))) if longest > 0 else MAX_PARTS


def steepness(motor: Servo | VelocityMotor, inertia: float, step: float) -> float:
    """Return kv on a coordinate of this inertia [N m s/rad] or [N s/m], at a time step [s].

    MuJoCo takes the forces of motors at their bounds as they are at the beginning of a step. All of a motor's torque T
    over a step h changes the rate of a coordinate of inertia I by T h / I. Where that is more than twice the speed
    error at which the motor leaves its bound, T / kv, it oscillates between its bounds. So kv is at most 2 I / h, and
    the step is cut into parts until the motor gives all of its torque at a speed error of at most a tenth of its
    largest velocity. I is the inertia at the start while all other coordinates are free: 1 / (M^-1) of the trees' mass
    matrix M.
    """
    return float(min(motor.torque / (WANTED_SPEED_ERROR * motor.velocity), 2 * inertia / step))


def inertias(start: StartState) -> Inertias:
    """Compute the inertia of each coordinate at the start while all others are free."""
    world, links = start.world, links_of(start.world)
    columns: list[Array] = []
    """Twists (6,) of the coordinates at the world's origin: velocity and angular velocity at a rate of 1."""
    owners: dict[int, tuple[str, int]] = {}
    above: dict[int | None, frozenset[int]] = {None: frozenset()}
    for link in links:
        held = above[link.parent]
        for name, number, twist in _freedoms(start, link.joint, link.body):
            if name:
                owners[len(columns)] = name, number
            held |= {len(columns)}
            columns.append(twist)
        above[link.body] = held
    mass = np.diag([_armature(world.joints, owners.get(k)) for k in range(len(columns))])
    for link in links:
        body, moving = world.bodies[link.body], sorted(above[link.body])
        if moving and not body.massless:
            centre = start.of(link.body, "position")
            turning = np.array([columns[k][3:] for k in moving]).T
            shifting = np.array([columns[k][:3] + np.cross(columns[k][3:], centre) for k in moving]).T
            axes = start.axes(link.body)
            tensor = axes @ np.array(ca.DM(inertia_matrix(body.inertia))) @ axes.T
            mass[np.ix_(moving, moving)] += body.mass * shifting.T @ shifting + turning.T @ tensor @ turning
    give = np.diag(np.linalg.pinv(mass, hermitian=True)) if columns else np.zeros(0)
    return {owner: 1 / max(float(give[k]), 1e-300) for k, owner in owners.items()}


def _freedoms(start: StartState, joint: int | None, body: int) -> Iterator[tuple[str, int, Array]]:
    """Yield name, number and twist (6,) at the world's origin of each coordinate; free motions have no name."""
    if joint is None:
        yield from (("", k, row) for k, row in enumerate(np.eye(6)))
        return
    made = start.world.joints[joint]
    side, frame = made.bodies[0], made.frames[0]
    point = start.of(side, "position") + start.axes(side) @ np.array(frame.point, float)
    if made.kind.name == "ball":
        yield from (("", k, np.concatenate([np.cross(point, row), row])) for k, row in enumerate(np.eye(3)))
        return
    for number, (slide, turn) in enumerate(start.motions(made)):
        yield made.name, number, np.concatenate([slide + np.cross(point, turn), turn])


def _armature(joints: tuple[Joint, ...], owner: tuple[str, int] | None) -> float:
    """Return the armature of a coordinate's joint [kg m^2] or [kg]."""
    return next((float(joint.armature) for joint in joints if owner and joint.name == owner[0]), 0.0)


def _longest(start: StartState, found: Inertias) -> Iterator[float]:
    """Yield the longest stable step of each motor, spring and compliant contact [s]."""
    joints = {joint.name: joint for joint in start.world.joints}
    for (name, _), inertia in found.items():
        motor, stiffness = joints[name].motor, _stiffness(joints[name])
        if isinstance(motor, Servo | VelocityMotor):
            yield 2 * MAX_SPEED_ERROR * motor.velocity * inertia / motor.torque
        if stiffness > 0:
            yield MAX_STEP_PHASE * math.sqrt(inertia / stiffness)
    for pair in start.world.pairs:
        if pair.law.soft:
            yield MAX_STEP_PHASE_CONTACT / (2 * math.pi * float(pair.law.frequency) * max(1.0, float(pair.law.damping)))


def _stiffness(joint: Joint) -> float:
    """Return the stiffness of a joint's spring and affine motor along each coordinate [N m/rad] or [N/m]."""
    spring = 0.0 if joint.spring is None else float(joint.spring.stiffness)
    motor = joint.motor
    return spring + (float(motor.kp) * float(motor.gear) ** 2 if isinstance(motor, AffineMotor) else 0.0)


def actuators(joint: Joint, inertias: Inertias, step: float) -> list[Element]:
    """Write an actuator for each coordinate of a joint with a motor, for a time step [s]."""
    if joint.motor is None:
        return []
    found = []
    for number, name in enumerate(names(joint)):
        kind, attributes = actuator(joint.motor, inertias.get((joint.name, number), inf), step)
        found.append(Element(kind, {"name": name, "joint": name, **attributes}))
    return found


def actuator(motor: Motor, inertia: float, step: float) -> tuple[str, dict[str, str]]:
    """Return the kind and the attributes of the nearest actuator for a motor on a coordinate of this inertia."""
    if isinstance(motor, AffineMotor):
        return affine(motor)
    bound = text((-motor.torque, motor.torque))
    if isinstance(motor, TorqueMotor):
        return "motor", {"ctrlrange": bound}
    kv = steepness(motor, inertia, step)
    attributes = {"kv": text([kv]), "forcerange": bound}
    if isinstance(motor, Servo):
        held = {} if motor.range is None else {"ctrlrange": text((-motor.range, motor.range))}
        return "position", {"kp": text([kv * motor.gain]), **attributes, **held}
    return "velocity", {**attributes, "ctrlrange": text((-motor.velocity, motor.velocity))}


def affine(motor: AffineMotor) -> tuple[str, dict[str, str]]:
    """Return the exact actuator: "motor" if the force is the command, "general" otherwise."""
    ranges = {"ctrlrange": motor.command_range, "forcerange": motor.force_range}
    found = {"gear": text([motor.gear])}
    found |= {key: text(bounded(ends)) for key, ends in ranges.items() if ends is not None and ends != (-inf, inf)}
    if motor.passive and is_zero(motor.offset) and is_zero(motor.gain - 1):
        return "motor", found
    bias = text([motor.offset, -motor.kp, -motor.kv])
    return "general", {**found, "gainprm": text([motor.gain]), "biastype": "affine", "biasprm": bias}


def site_actuator(name: str, motor: SiteMotor) -> Element:
    """Write the actuator of a site; in MuJoCo it is called as the site is."""
    ends = {} if motor.command_range is None else {"ctrlrange": text(bounded(motor.command_range))}
    return Element("motor", {"name": name, "site": name, "gear": text((*motor.force, *motor.torque)), **ends})


def bounded(ends: tuple[float, float]) -> tuple[float, float]:
    """Replace infinite bounds by numbers that MuJoCo takes."""
    return max(ends[0], -UNBOUNDED), min(ends[1], UNBOUNDED)


@dataclass(frozen=True)
class MjcfModel:
    """A model file.

    Attributes:
        text: the XML.
        departures: how the model differs from the world.
    """

    text: str
    departures: tuple[Departure, ...]


def problem_model(
    problem: Problem, approximate: bool = False, stiffer: Mapping[tuple[str, str], float] = MappingProxyType({})
) -> MjcfModel:
    """Write the world of a problem as a model; the other arguments are those of ``mjcf_model``."""
    dt, name = problem.simulation.dt, problem.name
    laws = [Departure("left out", (law.name,), "a force law; MuJoCo has no formulas") for law in problem.forces]
    text = "numbers that hold in a phase alone; a model of MuJoCo has one of each"
    laws += [Departure("left out", (phase.name,), text) for phase in problem.phases if phase.sets]
    world = problem.parametric.world({})
    felt = problem.sensors
    return mjcf_model(world, problem.initial, dt, name, felt, laws, approximate=approximate, stiffer=stiffer)


def mjcf_files(problem: Problem, approximate: bool = False) -> dict[str, bytes]:
    """Return the file of a problem's model, name -> content; ExportError names what MJCF cannot express."""
    return {f"{problem.name}.xml": problem_model(problem, approximate).text.encode()}


def mjcf(world: World, initial: Mapping[str, Any], dt: float, name: str = "world", approximate: bool = False) -> str:
    """Return the text of a model; the arguments are those of ``mjcf_model``."""
    return mjcf_model(world, initial, dt, name, approximate=approximate).text


def mjcf_model(
    world: World,
    initial: Mapping[str, Any],
    dt: float,
    name: str = "world",
    sensors: Sequence[Sensor] = (),
    laws: Sequence[Departure] = (),
    *,
    approximate: bool = False,
    stiffer: Mapping[tuple[str, str], float] = MappingProxyType({}),
) -> MjcfModel:
    """Write a world as a model, together with its differences from the world.

    Args:
        world: a world of numbers, without symbols.
        initial: the state at the start by name, SI units, world frame, as ``symphys.model.initial_state`` takes it.
        dt: time step [s].
        name: name of the model.
        sensors: sensors of the problem.
        laws: departures for the force laws and phases of the problem.
        approximate: leave out what MJCF cannot express, instead of refusing it.
        stiffer: factors on stiffness and damping of compliant contacts, by the names of their surfaces.

    Raises:
        ExportError: names everything that MJCF cannot express.
    """
    start = StartState(world, initial)
    felt = sensor_elements(world, sensors)
    acted_on = inertias(start)
    count = parts(start, acted_on, dt)
    step = dt / count
    found = [*laws, *departures(start), *shorter_step(dt, count)]
    require_expressible(found, name, approximate)
    if felt.left_out:
        found.append(Departure("left out", tuple(felt.left_out), "a sensor of a formula that MuJoCo has none for"))
    model = Element("mujoco", model=name)
    model.extend(Comment(f" {one_line(str(each))} ") for each in found)
    SubElement(model, "compiler", angle="radian", inertiafromgeom="false")
    options = {"timestep": repr(float(step)), "gravity": text(world.gravity)}
    options |= {"impratio": text([FRICTION_RATIO])} if any(pair.law.soft for pair in world.pairs) else {}
    SubElement(model, "option", {**options, "integrator": "implicitfast", "cone": "elliptic"})
    terrains = [static for static in world.statics if isinstance(static, Terrain)]
    assets = [*(height_field(start, terrain) for terrain in terrains), *meshes(world)]
    if assets:
        SubElement(model, "asset").extend(assets)
    numbers = Keyframe(start, nested_bodies(world), (*world.sites, *felt.sites))
    worldbody = SubElement(model, "worldbody")
    worldbody.extend(geoms(world, None))
    worldbody.extend(ground(start, terrain) for terrain in terrains)
    worldbody.extend(numbers.parts(None))
    model.append(pairs(world, step, stiffer))
    SubElement(model, "equality").extend(equalities(start.reference))
    motors = SubElement(model, "actuator")
    motors.extend(motor for joint in world.joints for motor in actuators(joint, acted_on, step))
    motors.extend(site_actuator(site.name, site.motor) for site in world.sites if site.motor is not None)
    SubElement(model, "sensor").extend(felt.elements)
    SubElement(SubElement(model, "keyframe"), "key", name="start", qpos=text(numbers.qpos), qvel=text(numbers.qvel))
    for empty in [each for each in model if each.tag in ("equality", "sensor") and not len(each)]:
        model.remove(empty)
    indent(model)
    return MjcfModel(tostring(model, encoding="unicode") + "\n", tuple(found))


def one_line(words: str) -> str:
    """Escape a text for a comment of XML."""
    return words.replace("--", "- -").rstrip("-")


def ground(start: StartState, terrain: Terrain) -> Element:
    """Write the geom of a height field."""
    place = {"pos": text(middle(start, terrain))}
    return Element("geom", {"name": terrain.name, "type": "hfield", "hfield": terrain.name, **place, **PAIRS_ONLY})


class Keyframe:
    """Nested elements of bodies, and the coordinates of the start in MuJoCo's order of joints.

    Attributes:
        qpos, qvel: the coordinates and velocities of the keyframe, filled while elements are written.
    """

    def __init__(self, start: StartState, found: list[NestedBody], sites: Sequence[Site]) -> None:
        """Begin with an empty keyframe."""
        self.start, self.nested, self.sites = start, found, sites
        self.qpos: list[float] = []
        self.qvel: list[float] = []

    def parts(self, parent: int | None) -> Iterator[Element]:
        """Write the sites and the child bodies of a body; those of the world for None."""
        yield from site_elements(self.sites, parent)
        for nested in self.nested:
            if nested.parent == parent:
                yield self.body(nested)

    def body(self, nested: NestedBody) -> Element:
        """Write a body: its pose in its parent's frame, its joints, inertia, geoms, sites and children."""
        body = self.start.world.bodies[nested.body]
        place, turn = relative(self.start.reference, nested)
        element = Element("body", name=body.name, pos=text(place), quat=text(turn))
        for freedom in freedoms(self.start, self.start.reference, nested):
            element.append(freedom.element)
            self.qpos += freedom.qpos.tolist()
            self.qvel += freedom.qvel.tolist()
        element.append(Element("inertial", {"pos": "0 0 0", "mass": text([body.mass]), **moments(body)}))
        element.extend(geoms(self.start.world, nested.body))
        element.extend(self.parts(nested.body))
        return element


def moments(body: Body) -> dict[str, str]:
    """Write the moments of inertia about the body's axes, or the tensor if these are not principal axes."""
    tensor = np.array(ca.DM(inertia_matrix(body.inertia)))
    if not (tensor - np.diag(np.diag(tensor))).any():
        return {"diaginertia": text(np.diag(tensor))}
    return {"fullinertia": text([*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2]])}
