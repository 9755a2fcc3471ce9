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
  (``mjcf_actuation``).
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

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any
from xml.etree.ElementTree import Comment, Element, SubElement, indent, tostring

import casadi as ca
import numpy as np

from symphys.dynamics.motion import inertia_matrix
from symphys.export.mjcf_actuation import actuators, inertias, parts
from symphys.export.mjcf_bodies import NestedBody, StartState, nested_bodies, relative
from symphys.export.mjcf_departures import Departure, departures, require_expressible, shorter_step
from symphys.export.mjcf_equality import equalities
from symphys.export.mjcf_joints import freedoms
from symphys.export.mjcf_sensors import sensor_elements, site_elements
from symphys.export.mjcf_surfaces import FRICTION_RATIO, PAIRS_ONLY, geoms, meshes, pairs, text
from symphys.export.mjcf_terrain import height_field, middle
from symphys.model.body import Body
from symphys.model.shapes import Terrain
from symphys.model.site import Site
from symphys.model.world import World
from symphys.problem import Problem
from symphys.problem.feedback import Sensor


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
    SubElement(model, "actuator").extend(motor for joint in world.joints for motor in actuators(joint, acted_on, step))
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
