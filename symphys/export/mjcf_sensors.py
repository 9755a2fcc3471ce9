"""Sites and sensors of MuJoCo for those sensors of a problem that have a counterpart."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from symphys.dynamics.observation import named_sensors
from symphys.export.mjcf_surfaces import text
from symphys.model.body import Body
from symphys.model.joints import AffineMotor, Joint, kinematic_trees
from symphys.model.site import Site
from symphys.model.world import World
from symphys.problem.feedback import Sensor

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
        sites: that sensors need beside those of the world.
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
