"""A world and its start as MJCF, the model files of MuJoCo.

Written as they are: bodies where the coordinates of joints are 0, their frames at the centres of mass, inertias, trees
of joints with the coordinates that they have here, frames without mass as several joints of one body, springs, dampers,
armature, torque motors and affine ones, gravity, time step, surfaces, sites, and which surfaces may touch: geoms meet
in explicit pairs only. The start is the keyframe ``start``. Where coordinates 0 would open a loop, bodies are written
at the start, and joints have their coordinates there as ``ref``.

For some things MuJoCo has laws of its own:

- Contacts, limits, dry friction, couplings and joints that close a loop are springs and dampers there, which act over
  several steps, with their default softness; here they are rigid. Friction of contacts is on the same disc (elliptic
  cone); torsion and rolling share one ellipsoid with it.
- A servo here aims at the velocity clip(gain (command - angle), +-velocity), and reaches it within a step unless that
  takes more than its torque. Nearest is a position actuator with kp = gain kv and the same bound of force. It aims at
  gain (command - angle), not held in +-velocity, and gives all of its torque only where the velocity is off by torque /
  kv: it sags under load. kv is 100 torque / velocity, or what the time step takes without swinging (``moving.step``).
- A velocity motor likewise becomes a velocity actuator with that kv.
- The time step is cut into parts where motors, springs or contacts that give way need it.
- A contact that gives way has the same frequency and damping ratio, by MuJoCo's own estimate of the mass behind it.
- Terrain is smooth here and triangles there, and ends at the edge of its grid.

Such actuators are stiff, hence the integrator ``implicitfast``. What has no counterpart is refused, or left out where
that is asked for: restitution, some joints that give way or close a loop, terrain without a grid. ``Departure`` is one
of all these, and the file begins with them. Variables, objectives and controllers are no part of a model, and commands
are its ctrl, 0 at the start.
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
from symphys.export.mjcf_bodies import NestedBody, StartState, nested_bodies, relative
from symphys.export.mjcf_departures import Departure, departures, require_expressible, shorter_step
from symphys.export.mjcf_equality import equalities
from symphys.export.mjcf_joints import freedoms
from symphys.export.mjcf_motors import actuators
from symphys.export.mjcf_sensors import sensor_elements, site_elements
from symphys.export.mjcf_surfaces import APART, FRICTION_RATIO, geoms, meshes, pairs, text
from symphys.export.mjcf_terrain import height_field, middle
from symphys.export.moving.step import inertias, parts
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
        text: of the file.
        departures: in what it differs from the world.
    """

    text: str
    departures: tuple[Departure, ...]


def problem_model(
    problem: Problem, approximate: bool = False, stiffer: Mapping[tuple[str, str], float] = MappingProxyType({})
) -> MjcfModel:
    """The model of a problem's world; see ``mjcf_model``."""
    dt, name = problem.simulation.dt, problem.name
    laws = [Departure("left out", (law.name,), "a force law; MuJoCo has no formulas") for law in problem.forces]
    text = "numbers that hold in a phase alone; a model of MuJoCo has one of each"
    laws += [Departure("left out", (phase.name,), text) for phase in problem.phases if phase.sets]
    world = problem.parametric.world({})
    felt = problem.sensors
    return mjcf_model(world, problem.initial, dt, name, felt, laws, approximate=approximate, stiffer=stiffer)


def mjcf_files(problem: Problem, approximate: bool = False) -> dict[str, bytes]:
    """name -> content of the one file; ExportError names what MJCF cannot say."""
    return {f"{problem.name}.xml": problem_model(problem, approximate).text.encode()}


def mjcf(world: World, initial: Mapping[str, Any], dt: float, name: str = "world", approximate: bool = False) -> str:
    """The text of a model; see ``mjcf_model``."""
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
    """A model, and in what it departs from the world.

    Args:
        world: plain numbers, no symbols.
        initial: the bodies' state at the start by name, SI units, world frame; see ``state.initial_state``.
        dt: time step [s].
        name: of the model.
        sensors: of the problem.
        laws: what of the problem's force laws is left out.
        approximate: leave out what MJCF cannot say, instead of refusing it.
        stiffer: factors on stiffness and damping of contacts that give way, by the names of their surfaces.

    Raises:
        ExportError: names all that MJCF cannot say.
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
    """What may stand in a comment of XML."""
    return words.replace("--", "- -").rstrip("-")


def ground(start: StartState, terrain: Terrain) -> Element:
    """The geom of a height field."""
    place = {"pos": text(middle(start, terrain))}
    return Element("geom", {"name": terrain.name, "type": "hfield", "hfield": terrain.name, **place, **APART})


class Keyframe:
    """Bodies as nested elements, and the numbers of the start in the order in which MuJoCo meets their joints."""

    def __init__(self, start: StartState, found: list[NestedBody], sites: Sequence[Site]) -> None:
        """Nothing written so far."""
        self.start, self.nested, self.sites = start, found, sites
        self.qpos: list[float] = []
        self.qvel: list[float] = []

    def parts(self, parent: int | None) -> Iterator[Element]:
        """What is fixed in a body, or in the world, and its children with their subtrees."""
        yield from site_elements(self.sites, parent)
        for nested in self.nested:
            if nested.parent == parent:
                yield self.body(nested)

    def body(self, nested: NestedBody) -> Element:
        """A body: where it is in its parent's frame, how it may move, what it is."""
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
    """Moments of inertia along the body's axes, or the tensor where these are not its principal ones."""
    tensor = np.array(ca.DM(inertia_matrix(body.inertia)))
    if not (tensor - np.diag(np.diag(tensor))).any():
        return {"diaginertia": text(np.diag(tensor))}
    return {"fullinertia": text([*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2]])}
