"""Sites of a model as [[site]] tables, and sensors whose reading a formula can express as [[sensor]] tables."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from symphys.importing.tables.reading import (
    FREE,
    HINGE,
    SLIDE,
    ModelReading,
    WeldedLink,
    is_upright,
    numbers,
    quaternion,
)
from symphys.records import dataclass
from symphys.types import Array

MIN_ARM = 1e-6
"""[m] An accelerometer that is farther from the centre of mass is approximated."""
MAX_BODIES = 100
"""Bodies in the formula of a centre of mass, at most."""
JOINTS = ("JOINTPOS", "JOINTVEL", "JOINTACTFRC")
AXES = {"FRAMEXAXIS": "[1, 0, 0]", "FRAMEYAXIS": "[0, 1, 0]", "FRAMEZAXIS": "[0, 0, 1]"}


def read_sites(reading: ModelReading) -> list[dict[str, Any]]:
    """Return a table for every site, and one for every named body that is part of another, at its frame.

    A site on a body that the world holds belongs to the world.
    """
    model, data, tables = reading.model, reading.data, list[dict[str, Any]]()
    for site in range(model.nsite):
        name = reading.names.give("site", reading.name("site", site), "site")
        tables.append(
            site_table(reading, name, int(model.site_bodyid[site]), data.site_xpos[site], data.site_xmat[site])
        )
    for body in range(1, model.nbody):
        link, given = reading.links.get(body), reading.name("body", body)
        if given and (link is None or link.top != body):
            name = reading.names.give("site", given, "site")
            tables.append(site_table(reading, name, body, data.xpos[body], data.xmat[body]))
    return tables


def site_table(reading: ModelReading, name: str, body: int, place: Any, matrix: Any) -> dict[str, Any]:
    """Return the [[site]] table of a frame, world axes, that is fixed to a body of the model."""
    link, place, axes = reading.links.get(body), np.array(place), np.array(matrix).reshape(3, 3)
    orientation = quaternion(axes) if link is None else link.turned(axes)
    table = {"name": name, "body": "world" if link is None else link.name}
    table["position"] = numbers(place if link is None else link.to_body(place))
    return table if is_upright(orientation) else {**table, "orientation": orientation}


def read_sensors(reading: ModelReading) -> list[dict[str, Any]]:
    """Return the tables of sensors whose reading a formula can express; others are noted."""
    tables, lost = list[dict[str, Any]](), Counter[str]()
    for sensor in range(reading.model.nsensor):
        kind = reading.library.mjtSensor(int(reading.model.sensor_type[sensor])).name.removeprefix("mjSENS_")
        reads = formula(reading, sensor, kind)
        if reads is None:
            lost[kind.lower()] += 1
            continue
        name = reading.names.give("sensor", reading.name("sensor", sensor), "sensor")
        tables.append({"name": name, "reads": reads})
    if lost:
        which = ", ".join(f"{count} {kind}" for kind, count in sorted(lost.items()))
        reading.note("left out", f"sensors: {which}", "no formula says what they read")
    return tables


def formula(reading: ModelReading, sensor: int, kind: str) -> str | None:
    """Return the formula of a sensor; None if there is none."""
    model, index = reading.model, int(reading.model.sensor_objid[sensor])
    if kind == "CLOCK":
        return "time"
    if kind in JOINTS:
        return of_joint(reading, index, kind)
    if kind in ("ACTUATORPOS", "ACTUATORVEL", "ACTUATORFRC"):
        return of_actuator(reading, index, kind)
    if kind in ("SUBTREECOM", "SUBTREELINVEL"):
        return of_subtree(reading, index, "position" if kind == "SUBTREECOM" else "velocity")
    if kind == "TOUCH":
        return of_touch(reading, index)
    if kind in ("GYRO", "ACCELEROMETER", "VELOCIMETER", "FORCE", "TORQUE"):
        frame = frame_of(reading, int(reading.library.mjtObj.mjOBJ_SITE), index)
        return None if frame is None else of_inertial_unit(reading, frame, index, kind)
    if kind.startswith("FRAME") and int(model.sensor_refid[sensor]) < 0:
        frame = frame_of(reading, int(model.sensor_objtype[sensor]), index)
        return None if frame is None else frame.reads(kind)
    return None


def of_joint(reading: ModelReading, joint: int, kind: str) -> str | None:
    """Return coordinate, rate or force of a hinge or slider."""
    model, name = reading.model, reading.joint_names.get(joint)
    if name is None or model.jnt_type[joint] not in (HINGE, SLIDE):
        return None
    if kind == "JOINTVEL":
        return f"{name}.rate"
    if kind == "JOINTACTFRC":
        return f"{name}.torque" if name in reading.driven else None
    value = f"{name}.{'angle' if model.jnt_type[joint] == HINGE else 'position'}"
    reference = numbers(reading.reference(joint))
    return f"{value} + {reference}" if reference else value


def of_actuator(reading: ModelReading, actuator: int, kind: str) -> str | None:
    """Return length, velocity or force of an actuator, on its side of the gear."""
    model, types = reading.model, reading.library.mjtTrn
    joint, gear = int(model.actuator_trnid[actuator][0]), numbers(float(model.actuator_gear[actuator][0]))
    if int(model.actuator_trntype[actuator]) not in (int(types.mjTRN_JOINT), int(types.mjTRN_JOINTINPARENT)):
        return None
    if kind == "ACTUATORFRC":
        name = reading.joint_names.get(joint, "")
        return f"{name}.torque / {gear}" if name in reading.driven and gear else None
    inside = of_joint(reading, joint, "JOINTPOS" if kind == "ACTUATORPOS" else "JOINTVEL")
    return None if inside is None else f"{gear} * ({inside})"


def of_subtree(reading: ModelReading, body: int, field: str) -> str | None:
    """Return the centre of mass of a body and all its descendants, or its velocity."""
    model = reading.model
    inside = {body}
    for other in range(body + 1, model.nbody):
        inside |= {other} if int(model.body_parentid[other]) in inside else set()
    links = {reading.links[each].top: reading.links[each] for each in inside if each in reading.links}
    whole = all(set(link.members) <= inside for link in links.values())
    heavy = [link for link in links.values() if link.mass]
    still = any(model.body_mass[each] and each not in reading.links for each in inside)
    if not whole or still or not 0 < len(heavy) <= MAX_BODIES:
        return None
    parts = " + ".join(f"{numbers(link.mass)} * {link.name}.{field}" for link in heavy)
    return f"({parts}) / {numbers(sum(link.mass for link in heavy))}"


def of_touch(reading: ModelReading, site: int) -> str | None:
    """Return the force on the body of a site."""
    link = reading.links.get(int(reading.model.site_bodyid[site]))
    if link is None or not link.mass:
        return None
    text = "all that presses on its body, in any direction"
    reading.note("approximated", f"touch at {reading.called('site', site)}", text)
    return f"norm({link.name}.contact_force)"


@dataclass(frozen=True)
class SensorFrame:
    """A frame on a link.

    Attributes:
        link: with mass.
        offset: (3,) from its centre of mass, in its axes [m].
        orientation: (4,) in its axes.
    """

    link: WeldedLink
    offset: Array
    orientation: list[float]

    @property
    def arm(self) -> str:
        """The vector from the centre of mass to the frame, world axes; empty if it is 0."""
        offset = numbers(self.offset)
        return f"rotate({self.link.name}.orientation, {offset})" if any(offset) else ""

    def reads(self, kind: str) -> str | None:
        """Return the formula of a frame sensor, world axes; None if there is none."""
        name = self.link.name
        if kind == "FRAMEPOS":
            return f"{name}.position + {self.arm}" if self.arm else f"{name}.position"
        if kind == "FRAMELINVEL":
            return f"{name}.velocity + cross({name}.angular_velocity, {self.arm})" if self.arm else f"{name}.velocity"
        if kind == "FRAMEANGVEL":
            return f"{name}.angular_velocity"
        if kind == "FRAMEQUAT" and is_upright(self.orientation):
            return f"{name}.orientation"
        if kind in AXES:
            return f"rotate({name}.orientation, rotate({self.orientation}, {AXES[kind]}))"
        return None

    def own_axes(self, vector: str) -> str:
        """Return a vector in the body's axes, in those of the frame."""
        w, x, y, z = self.orientation
        return vector if is_upright(self.orientation) else f"rotate({[w, -x, -y, -z]}, {vector})"


def frame_of(reading: ModelReading, kind: int, index: int) -> SensorFrame | None:
    """Return the frame of a site, geom or body (of a body its inertia's); None if it stands still."""
    model, data, objects = reading.model, reading.data, reading.library.mjtObj
    body, place, axes = index, data.xpos, data.xmat
    if kind == int(objects.mjOBJ_SITE):
        body, place, axes = int(model.site_bodyid[index]), data.site_xpos, data.site_xmat
    elif kind == int(objects.mjOBJ_GEOM):
        body, place, axes = int(model.geom_bodyid[index]), data.geom_xpos, data.geom_xmat
    elif kind == int(objects.mjOBJ_BODY):
        place, axes = data.xipos, data.ximat
    elif kind != int(objects.mjOBJ_XBODY):
        return None
    link = reading.links.get(body)
    if link is None or not link.mass:
        return None
    turned = link.turned(np.array(axes[index]).reshape(3, 3))
    return SensorFrame(link, link.to_body(np.array(place[index])), turned)


def of_inertial_unit(reading: ModelReading, frame: SensorFrame, site: int, kind: str) -> str | None:
    """Return the reading of a gyro, accelerometer, velocimeter, force or torque sensor, in the axes of a site."""
    name = frame.link.name
    if kind == "GYRO":
        return frame.own_axes(f"{name}.gyro")
    if kind == "VELOCIMETER":
        q = f"{name}.orientation"
        return frame.own_axes(f"rotate([{q}[0], -{q}[1], -{q}[2], -{q}[3]], {frame.reads('FRAMELINVEL')})")
    if kind in ("FORCE", "TORQUE"):
        return of_joint_before(reading, frame, site, kind)
    arm = float(np.linalg.norm(frame.offset))
    if arm > MIN_ARM:
        text = "it is at the centre of mass of its body here"
        reading.note("approximated", f"accelerometer at {reading.called('site', site)}", text, f"{1000 * arm:.3g} mm")
    return frame.own_axes(f"{name}.accelerometer")


def of_joint_before(reading: ModelReading, frame: SensorFrame, site: int, kind: str) -> str | None:
    """Return the force of the parent on a site's body, or its torque about the site, in the axes of the site.

    None where the body is welded to its parent, or floats.
    """
    body = int(reading.model.site_bodyid[site])
    joints = reading.joints_of(body)
    held = body in reading.links and reading.links[body].top == body and len(joints)
    if not held or reading.model.jnt_type[joints[-1]] == FREE:
        return None
    name = reading.joint_names[joints[-1]]
    if kind == "FORCE":
        return frame.own_axes(f"{name}.reaction_force")
    arm = numbers(frame.offset - frame.link.to_body(np.array(reading.data.xanchor[joints[-1]])))
    moment = f" - cross({arm}, {name}.reaction_force)" if any(arm) else ""
    return frame.own_axes(f"{name}.reaction_torque{moment}")
