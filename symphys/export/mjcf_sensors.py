"""Sites and sensors: what formulas of a problem read where MJCF has a sensor for it."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

import numpy as np

from symphys.export.mjcf_surfaces import text
from symphys.model.joints import AffineMotor
from symphys.model.site import Site
from symphys.model.world import World
from symphys.problem.feedback import Sensor

JOINTS = {"angle": "jointpos", "position": "jointpos", "rate": "jointvel", "torque": "jointactuatorfrc"}
BODIES = {
    "position": ("framepos", "body"),
    "orientation": ("framequat", "xbody"),
    "velocity": ("framelinvel", "body"),
    "angular_velocity": ("frameangvel", "xbody"),
}
"""MuJoCo's ``body`` is at the centre of mass, with principal axes; ``xbody`` has the body's own axes."""
SITES = {"position": "framepos", "orientation": "framequat", "velocity": "framelinvel"}
NUMBERS = r"(\[[^\[\]]*\])"
AT_A_POINT = {
    "framepos": re.compile(rf"(\w+)\.position \+ rotate\(\1\.orientation, {NUMBERS}\)"),
    "framelinvel": re.compile(
        rf"(\w+)\.velocity \+ cross\(\1\.angular_velocity, rotate\(\1\.orientation, {NUMBERS}\)\)"
    ),
}
"""Formulas of a point (3,) in a body's frame."""
FELT = re.compile(rf"(?:rotate\({NUMBERS}, )?(\w+)\.(gyro|accelerometer)\)?")
"""Formulas of what is felt in a body's axes, or in others, to which a quaternion (4,) goes."""
NEAR = 1e-9
"""[m], or of quaternions: sites that are apart by less are one."""


@dataclass
class SensorElements:
    """Sensors of a model.

    Attributes:
        elements: of the sensors.
        sites: that sensors need beside those of the world.
        left_out: names of sensors without counterpart.
    """

    elements: list[Element] = field(default_factory=list)
    sites: list[Site] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)


def sensor_elements(world: World, sensors: Sequence[Sensor]) -> SensorElements:
    """All that have a counterpart; a sensor of several formulas becomes as many, with numbers."""
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
    """The sensor of a formula that is one name; None where there is none. ``sites`` gets the one that it needs."""
    if formula == "time":
        return Element("clock", name=name)
    geared = {
        f"{joint.name}.torque / {joint.motor.gear}": joint.name
        for joint in world.joints
        if isinstance(joint.motor, AffineMotor) and len(joint.kind.coordinates) == 1
    }
    if formula in geared:
        return Element("actuatorfrc", name=name, actuator=geared[formula])
    owner, _, key = formula.rpartition(".")
    single = {joint.name for joint in world.joints if len(joint.kind.coordinates) == 1}
    if owner in single and key in JOINTS:
        return Element(JOINTS[key], name=name, joint=owner)
    if owner in {site.name for site in world.sites} and key in SITES:
        return Element(SITES[key], name=name, objtype="site", objname=owner)
    bodies = {body.name: k for k, body in enumerate(world.bodies) if not body.massless}
    if owner in bodies and key in BODIES:
        kind, frame = BODIES[key]
        return Element(kind, name=name, objtype=frame, objname=owner)
    for kind, pattern in AT_A_POINT.items():
        if (found := pattern.fullmatch(formula)) and found[1] in bodies:
            site = site_at(world, sites, bodies[found[1]], position=json.loads(found[2]))
            return Element(kind, name=name, objtype="site", objname=site.name)
    if (found := FELT.fullmatch(formula)) and found[2] in bodies and formula.endswith(")") == bool(found[1]):
        w, x, y, z = json.loads(found[1] or "[1, 0, 0, 0]")
        place = None if found[3] == "gyro" else (0.0, 0.0, 0.0)
        site = site_at(world, sites, bodies[found[2]], place, (w, -x, -y, -z))
        return Element(found[3], name=name, site=site.name)
    return None


def site_at(
    world: World,
    sites: list[Site],
    body: int,
    position: Sequence[float] | None = None,
    orientation: Sequence[float] | None = None,
) -> Site:
    """A site of a body with this place and these axes, any where they are None.

    It is made and put into ``sites`` where there is none.
    """
    for site in (*world.sites, *sites):
        near = position is None or np.allclose(np.array(site.position, float), position, atol=NEAR)
        alike = orientation is None or abs(np.dot(np.array(site.orientation, float), orientation)) > 1 - NEAR
        if site.body == body and near and alike:
            return site
    name = f"{world.bodies[body].name}_sensor{len(sites) or ''}"
    sites.append(Site(name, body, position or (0.0, 0.0, 0.0), orientation or (1.0, 0.0, 0.0, 0.0)))
    return sites[-1]


def site_elements(sites: Sequence[Site], body: int | None) -> list[Element]:
    """The sites of a body, in its frame; those of the world for None."""
    return [
        Element("site", name=site.name, pos=text(site.position), quat=text(site.orientation))
        for site in sites
        if site.body == body
    ]
