"""Joints of a model as [[joint]] and [[coupling]] tables: chains with frames between them, motors, closed loops."""

from __future__ import annotations

from collections.abc import Container, Sequence
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from symphys.importing.tables.links import frame_table
from symphys.importing.tables.pose import range_of
from symphys.importing.tables.reading import (
    BALL,
    FREE,
    HINGE,
    SLIDE,
    ModelReading,
    WeldedLink,
    matrix,
    numbers,
)
from symphys.model.gimbal import Screw, locks
from symphys.records import dataclass
from symphys.types import Array

PARALLEL_TOLERANCE = 1e-9
"""Largest deviation of the cosine between the axes of a screw's two joints from 1."""
ROTOR_SHARE, MIN_ROTOR = 0.1, 1e-6
"""Armature against gimbal lock: a share of a body's largest moment of inertia, at least LEAST_ROTOR [kg m^2]."""
FIXED, AFFINE = 0, 1
"""MuJoCo's types of gains; biases have NONE = 0 and AFFINE = 1."""
INTEGRATOR, FILTER_EXACT = 1, 3
"""MuJoCo's types of activation: none is 0, and those beyond are not linear."""
Motor = dict[str, Any]
"""All keys of ``motor.affine``."""
FREE_RANGE = [-np.inf, np.inf]
DEFAULTS = {
    "gain": 1.0,
    "offset": 0.0,
    "kp": 0.0,
    "kv": 0.0,
    "gear": 1.0,
    "command_range": FREE_RANGE,
    "force_range": FREE_RANGE,
}
MAX_LOOP_GAP = 1e-6
"""[m], [rad] How far apart the sides of a loop may be at the reference pose."""


def read_joints(reading: ModelReading) -> tuple[dict[int, list[dict[str, Any]]], list[dict[str, Any]]]:
    """Return (frames before each link, by its top body; [[joint]] tables)."""
    frames, joints = dict[int, list[dict[str, Any]]](), list[dict[str, Any]]()
    found = find_screws(reading)
    for top, link in reading.links.items():
        if top == link.top:
            frames[top], more = chain(reading, link, found)
            joints += more
    return frames, joints


@dataclass(frozen=True)
class ThreadedPair:
    """A slide that follows a hinge about the same axis: indices of joints and of the equality, ``pitch`` [m]."""

    hinge: int
    slide: int
    equality: int
    pitch: float


def find_screws(reading: ModelReading) -> list[ThreadedPair]:
    """Find the screws of a model: a hinge and a slide tied by an equality, with nothing else on the slide."""
    model, found = reading.model, list[ThreadedPair]()
    for equality in range(model.neq):
        if int(model.eq_type[equality]) != int(reading.library.mjtEq.mjEQ_JOINT) or not reading.holds(equality):
            continue
        ids = int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])
        types, (constant, ratio, *others) = [int(model.jnt_type[k]) for k in ids], model.eq_data[equality][:5]
        if min(ids) < 0 or sorted(types) != [SLIDE, HINGE] or constant or any(others) or not ratio:
            continue
        slide, hinge = ids if types[0] == SLIDE else ids[::-1]
        cosine = float(np.dot(reading.data.xaxis[slide], reading.data.xaxis[hinge]))
        next_to = abs(slide - hinge) == 1 and model.jnt_bodyid[slide] == model.jnt_bodyid[hinge]
        if next_to and abs(cosine) > 1 - PARALLEL_TOLERANCE and not burdened(reading, slide, equality):
            lead = float(ratio if types[0] == SLIDE else 1 / ratio) * np.sign(cosine)
            found.append(ThreadedPair(hinge, slide, equality, 2 * np.pi * lead))
    return found


def burdened(reading: ModelReading, joint: int, equality: int) -> bool:
    """Whether anything but one equality constraint acts on a joint or reads it."""
    model, types = reading.model, reading.library
    dof = int(model.jnt_dofadr[joint])
    own = (model.jnt_stiffness[joint], model.dof_damping[dof], model.dof_armature[dof], model.dof_frictionloss[dof])
    others = [k for k in range(model.neq) if k != equality and int(model.eq_type[k]) == int(types.mjtEq.mjEQ_JOINT)]
    users = [model.eq_obj1id[others], model.eq_obj2id[others]]
    users.append(model.actuator_trnid[:, 0][model.actuator_trntype == int(types.mjtTrn.mjTRN_JOINT)])
    users.append(model.sensor_objid[model.sensor_objtype == int(types.mjtObj.mjOBJ_JOINT)])
    users.append(model.wrap_objid[model.wrap_type == int(types.mjtWrap.mjWRAP_JOINT)])
    return any(own) or bool(model.jnt_limited[joint]) or any(joint in ids for ids in users)


def chain(
    reading: ModelReading, link: WeldedLink, found: Sequence[ThreadedPair]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Make the frames and joints from the parent of a link to it; ``found``: the screws of the model."""
    pitches, slides = {each.hinge: each.pitch for each in found}, {each.slide for each in found}
    model, indices = reading.model, [k for k in reading.joints_of(link.top) if k not in slides]
    free = [j for j in indices if model.jnt_type[j] == FREE]
    for joint in free:
        reading.joint_names[joint] = link.name
        dof = int(model.jnt_dofadr[joint])
        acting = {
            "armature": model.dof_armature[dof : dof + 6],
            "damping": model.dof_damping[dof : dof + 6],
            "friction": model.dof_frictionloss[dof : dof + 6],
            "stiffness": model.jnt_stiffness[joint],
        }
        lost_forces(reading, f"the free {reading.called('joint', joint)}", acting, "a body that floats has none")
    indices = [j for j in indices if j not in free]
    if not indices:
        return [], []
    parent = reading.links.get(int(model.body_parentid[link.top]))
    before = "world" if parent is None else parent.name
    frames, joints = list[dict[str, Any]](), list[dict[str, Any]]()
    for joint in indices:
        name = reading.names.give("joint", reading.name("joint", joint), f"{link.name}_joint")
        reading.joint_names[joint] = name
        last = joint == indices[-1]
        after = link.name if last else reading.names.give("frame", f"{link.name}_{name}")
        if not last:
            frames.append(frame_table(after, np.array(reading.data.xanchor[joint])))
        joints.append(joint_table(reading, joint, name, (before, after), pitches.get(joint)))
        before = after
    if len(indices) > 1 and locks(
        [screw for joint in indices for screw in screws_of(reading, joint, pitches.get(joint, 0.0))]
    ):
        carried = max(ROTOR_SHARE * float(np.max(model.body_inertia[link.top])), MIN_ROTOR)
        joints[0]["armature"] = numbers(carried)
        text = "axes of several joints of one body can come together, where frames without mass have no inertia"
        reading.note("approximated", f"armature of {reading.called('joint', indices[0])}", text, f"{carried:.3g}")
    return frames, joints


def screws_of(reading: ModelReading, joint: int, pitch: float) -> list[Screw]:
    """Return the coordinates of a joint at the reference pose; ``pitch`` [m] of a screw."""
    model, point = reading.model, np.array(reading.data.xanchor[joint], float)
    carried = bool(model.dof_armature[int(model.jnt_dofadr[joint])])
    if model.jnt_type[joint] == BALL:
        return [Screw(axis, point, carried=carried) for axis in np.eye(3)]
    axis, slides = np.array(reading.data.xaxis[joint], float), model.jnt_type[joint] == SLIDE
    low, high = range_of(reading, joint)
    return [Screw(axis, None if slides else point, low, high, carried, pitch / (2 * np.pi))]


def lost_forces(reading: ModelReading, what: str, acting: dict[str, Any], why: str) -> None:
    """Note forces of MuJoCo that do not act here: by key, the numbers that would set them."""
    for key, values in acting.items():
        if np.any(np.asarray(values)):
            reading.note("left out", f"{key} of {what}", why, f"{np.max(values):g}")


def joint_table(
    reading: ModelReading, joint: int, name: str, between: tuple[str, str], pitch: float | None
) -> dict[str, Any]:
    """Make the table of a joint; ``pitch`` [m] of a screw, None for others."""
    model, kind = reading.model, int(reading.model.jnt_type[joint])
    table: dict[str, Any] = {"name": name, "between": list(between)}
    axis = numbers(np.array(reading.data.xaxis[joint]))
    if kind == BALL:
        table["ball"] = {}
    elif pitch is not None:
        table["helical"] = {"axis": axis, "pitch": numbers(pitch)}
    else:
        table["hinge" if kind == HINGE else "slider"] = {"axis": axis}
    table["point"] = numbers(np.array(reading.data.xanchor[joint]))
    dof = int(model.jnt_dofadr[joint])
    armature, friction = float(model.dof_armature[dof]), float(model.dof_frictionloss[dof])
    if armature:
        table["armature"] = numbers(armature)
    if kind == BALL:
        acting = {
            "damping": model.dof_damping[dof],
            "friction": friction,
            "stiffness": model.jnt_stiffness[joint],
            "limit": float(model.jnt_limited[joint]),
        }
        why = "a ball joint has no coordinates along which it could act"
        lost_forces(reading, reading.called("joint", joint), acting, why)
        return table
    if friction and not reading.off("FRICTIONLOSS"):
        table["friction"] = numbers(friction)
    spring = spring_of(reading, joint, dof)
    if spring:
        table["spring"] = spring
    low, high = range_of(reading, joint)
    if isfinite(low) or isfinite(high):
        table["limits"] = numbers([low, high])
    return table


def spring_of(reading: ModelReading, joint: int, dof: int) -> dict[str, float]:
    """Return stiffness, damping and rest, where the spring gives no force, relative to the reference pose."""
    model = reading.model
    stiffness = 0.0 if reading.off("SPRING") else float(model.jnt_stiffness[joint])
    damping = 0.0 if reading.off("DAMPER") else float(model.dof_damping[dof])
    beyond = ("jnt_stiffnesspoly", joint, "stiffness"), ("dof_dampingpoly", dof, "damping")
    for key, at, what in beyond:
        if np.any(getattr(model, key, np.zeros(max(joint, dof) + 1))[at]):
            text = "terms beyond the linear one have no counterpart"
            reading.note("left out", f"nonlinear {what} of {reading.called('joint', joint)}", text)
    found: dict[str, float] = {}
    if stiffness:
        found["stiffness"] = numbers(stiffness)
        rest = float(model.qpos_spring[model.jnt_qposadr[joint]]) - reading.reference(joint)
        if abs(rest) > 1e-15:
            found["rest"] = numbers(rest)
    if damping:
        found["damping"] = numbers(damping)
    return found


def read_motors(reading: ModelReading, joints: list[dict[str, Any]]) -> None:
    """Put motors into [[joint]] tables: those of actuators, and those that a URDF gives its joints."""
    model, by_name = reading.model, {table["name"]: table for table in joints}
    renamed, drives = [], dict[int, list[tuple[int, Motor]]]()
    for actuator in range(len(model.actuator_trntype)):
        found = target(reading, actuator)
        motor = None if found is None else affine(reading, actuator, *found)
        if found is None or motor is None:
            continue
        drives.setdefault(found[0], []).append((actuator, motor))
    for joint, several in drives.items():
        name = reading.joint_names[joint]
        by_name[name]["motor"] = {"affine": written(combined(reading, name, several))}
        first = reading.name("actuator", several[0][0])
        if first != name:
            renamed.append(f"{first or several[0][0]}: {name}.command")
    if renamed:
        reading.note("taken", f"{len(renamed)} actuators by the names of their joints", ", ".join(renamed))
    for joint, name in reading.joint_names.items():
        own = reading.motors.get(reading.name("joint", joint))
        table = by_name.get(name)
        if own is not None and own.effort > 0 and table is not None and "motor" not in table and "ball" not in table:
            table["motor"] = {"torque": {"torque": numbers(own.effort)}}


def combined(reading: ModelReading, joint: str, several: Sequence[tuple[int, Motor]]) -> Motor:
    """Return the one motor of a joint: that of its first actuator, with the forces of others at command 0.

    Forces of springs and dampers add up where nothing bounds them, each seen through its gear.
    """
    (first, law), others = several[0], several[1:]
    for actuator, other in others:
        what, main = reading.called("actuator", actuator), reading.called("actuator", first)
        ratio = other["gear"] / law["gear"] if law["gear"] else 0.0
        if law["gear"] == 0 or np.isfinite([*law["force_range"], *other["force_range"]]).any():
            reading.note("left out", what, f"{joint} has one motor, which is {main}")
            continue
        law = {
            **law,
            "offset": law["offset"] + ratio * other["offset"],
            "kp": law["kp"] + ratio * ratio * other["kp"],
            "kv": law["kv"] + ratio * ratio * other["kv"],
        }
        reading.note("approximated", what, f"{joint} has one motor, which is {main}; this acts as with command 0")
    return law


def written(law: Motor) -> dict[str, Any]:
    """Return the keys of ``motor.affine`` that differ from their defaults."""
    return {key: numbers(value) for key, value in law.items() if value != DEFAULTS[key]}


def target(reading: ModelReading, actuator: int) -> tuple[int, float] | None:
    """Return the joint that an actuator drives, and the gear between them."""
    model, types = reading.model, reading.library.mjtTrn
    kind, gear = int(model.actuator_trntype[actuator]), float(model.actuator_gear[actuator][0])
    index = int(model.actuator_trnid[actuator][0])
    what = reading.called("actuator", actuator)
    if kind == int(types.mjTRN_TENDON):
        found = through_tendon(reading, index)
        if found is None:
            reading.note("left out", what, "tendons over several joints, or along sites, have no counterpart")
            return None
        index, gear = found[0], gear * found[1]
        text = f"its tendon runs over {reading.called('joint', index)} alone, which it drives with a gear"
        reading.note("taken", what, text)
        kind = int(types.mjTRN_JOINT)
    if kind == int(types.mjTRN_SITE):
        return None  # see ``site_motors``
    if kind not in (int(types.mjTRN_JOINT), int(types.mjTRN_JOINTINPARENT)):
        reading.note("left out", what, "adhesion of bodies and slider-cranks have no counterpart")
        return None
    if reading.off("ACTUATION"):
        reading.note("left out", what, "the model's options switch actuators off")
        return None
    if model.jnt_type[index] not in (HINGE, SLIDE) or index not in reading.joint_names:
        reading.note("left out", what, "motors drive hinges and sliders that can move")
        return None
    return index, gear


def through_tendon(reading: ModelReading, tendon: int) -> tuple[int, float] | None:
    """Return the one joint that a fixed tendon moves, and its coefficient; None if there are several."""
    model = reading.model
    first, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
    wraps = range(first, first + count)
    if any(int(model.wrap_type[wrap]) != int(reading.library.mjtWrap.mjWRAP_JOINT) for wrap in wraps):
        return None
    moving = [wrap for wrap in wraps if model.wrap_prm[wrap]]
    return (int(model.wrap_objid[moving[0]]), float(model.wrap_prm[moving[0]])) if len(moving) == 1 else None


class ActuatorLaw(NamedTuple):
    """The force of an actuator before its gear: gain times the command, and a bias by 1, position and velocity."""

    gain: float
    bias: Array
    command_range: list[float]


def actuator_law(reading: ModelReading, actuator: int) -> ActuatorLaw | None:
    """Return the law of an actuator; None if it is not affine."""
    model, what = reading.model, reading.called("actuator", actuator)
    gain, bias = model.actuator_gainprm[actuator], np.array(model.actuator_biasprm[actuator][:3], float)
    fixed = int(model.actuator_gaintype[actuator]) == FIXED
    constant = fixed or (int(model.actuator_gaintype[actuator]) == AFFINE and not np.any(gain[1:3]))
    dynamics = int(model.actuator_dyntype[actuator])
    if not constant or int(model.actuator_biastype[actuator]) not in (0, AFFINE) or dynamics > FILTER_EXACT:
        text = "muscles, DC motors, and gains that depend on the state have no counterpart"
        reading.note("left out", what, text)
        return None
    clamped = bool(model.actuator_ctrllimited[actuator]) and not reading.off("CLAMPCTRL")
    at = actuator if model.nu == len(model.actuator_trntype) else int(model.actuator_ctrladr[actuator])
    command = [float(end) for end in model.actuator_ctrlrange[at]] if clamped else [-np.inf, np.inf]
    if dynamics == INTEGRATOR:
        text = "the command is what the actuator would integrate it to"
        reading.note("approximated", f"activation of {what}", text)
        held = bool(model.actuator_actlimited[actuator])
        command = [float(end) for end in model.actuator_actrange[actuator]] if held else [-np.inf, np.inf]
    elif dynamics:
        tau = float(model.actuator_dynprm[actuator][0])
        reading.note("approximated", f"activation of {what}", "the command acts at once", f"{tau:g} s")
    for key in ("delay", "damping", "armature"):  # of the actuator itself: MuJoCo has them since 4.0
        value = getattr(model, f"actuator_{key}", None)
        if value is not None and np.any(value[actuator]):
            reading.note("left out", f"{key} of {what}", "motors have none", f"{float(np.max(value[actuator])):g}")
    return ActuatorLaw(float(gain[0]), bias if model.actuator_biastype[actuator] else np.zeros(3), command)


def affine(reading: ModelReading, actuator: int, joint: int, gear: float) -> Motor | None:
    """Return the motor of a joint that an actuator is; None if it is not affine."""
    law = actuator_law(reading, actuator)
    if law is None:
        return None
    # MuJoCo's length is gear times its coordinate, which is not 0 at the reference pose
    offset = float(law.bias[0] + law.bias[1] * gear * reading.reference(joint))
    found: Motor = {"gain": law.gain, "offset": offset, "kp": -float(law.bias[1]), "kv": -float(law.bias[2])}
    ends = force_range(reading, actuator, joint, gear)
    return {**found, "gear": gear, "command_range": law.command_range, "force_range": ends}


def force_range(reading: ModelReading, actuator: int, joint: int, gear: float) -> list[float]:
    """Return the limits of the force before the gear: the actuator's own, within those of its joint."""
    model, ends = reading.model, [-np.inf, np.inf]
    if model.actuator_forcelimited[actuator]:
        ends = [float(end) for end in model.actuator_forcerange[actuator]]
    if model.jnt_actfrclimited[joint] and gear:
        own = sorted(float(end) / gear for end in model.jnt_actfrcrange[joint])
        ends = [max(ends[0], own[0]), min(ends[1], own[1])]
    return [ends[0], max(ends)]


def read_couplings(reading: ModelReading) -> list[dict[str, Any]]:
    """Make the [[coupling]] tables, of the equality constraints of coordinates."""
    model, found = reading.model, list[dict[str, Any]]()
    screws = [each.equality for each in find_screws(reading)]
    for equality in (k for k in range(model.neq) if k not in screws):
        if int(model.eq_type[equality]) == int(reading.library.mjtEq.mjEQ_JOINT) and reading.holds(equality):
            table = coupling(reading, equality)
            found += [table] if table else []
    reading.rigid += len(found) + len(screws)
    return found


def read_loops(reading: ModelReading, touching: Container[tuple[str, ...]]) -> list[dict[str, Any]]:
    """Make the [[joint]] tables that close loops, of all equality constraints but those of coordinates.

    Bodies that a loop holds together may touch as the model lets them: ``touching``, names in alphabetical order.
    """
    model, types = reading.model, reading.library.mjtEq
    joints = list[dict[str, Any]]()
    for equality in range(model.neq):
        kind, what = int(model.eq_type[equality]), reading.called("equality", equality)
        if not reading.holds(equality):
            reading.note("left out", what, "it is not active")
        elif kind in (int(types.mjEQ_CONNECT), int(types.mjEQ_WELD)):
            table = loop(reading, equality, kind == int(types.mjEQ_WELD))
            if table and tuple(sorted(table["between"])) in touching:
                table["collide"] = True
            joints += [table] if table else []
            reading.rigid += bool(table)
        elif kind != int(types.mjEQ_JOINT):
            reading.note("left out", what, "constraints of tendons and of flexible bodies have no counterpart")
    if reading.rigid:
        reading.note("approximated", f"softness of {reading.rigid} equality constraints", "they are rigid here")
    return joints


def coupling(reading: ModelReading, equality: int) -> dict[str, Any] | None:
    """Return the coupling of two coordinates, both of which are 0 at the reference pose, as in MuJoCo."""
    model = reading.model
    ids = [int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])]
    used = [joint for joint in ids if joint >= 0]
    known = all(joint in reading.joint_names for joint in used)
    if not known or any(model.jnt_type[joint] not in (HINGE, SLIDE) for joint in used):
        reading.note("left out", reading.called("equality", equality), "it must be between hinges and sliders")
        return None
    if len({root_of(reading, int(model.jnt_bodyid[joint])) for joint in used}) > 1:
        text = "its joints hang on the world one by one, and coordinates are coupled within a robot only"
        reading.note("left out", reading.called("equality", equality), text)
        return None
    name = reading.names.give("coupling", reading.name("equality", equality), "coupling")
    polynomial = numbers(np.array(model.eq_data[equality][:5]))
    return {"name": name, "joints": [reading.joint_names[joint] for joint in used], "polynomial": polynomial}


def root_of(reading: ModelReading, body: int) -> int:
    """Return the top body of the link from which all others of its tree hang."""
    link = reading.links[body]
    above = reading.links.get(int(reading.model.body_parentid[link.top]))
    return link.top if above is None else root_of(reading, above.top)


def loop(reading: ModelReading, equality: int, weld: bool) -> dict[str, Any] | None:
    """Return a joint that closes a loop: two points stay together, or two bodies."""
    what = reading.called("equality", equality)
    one, other, where, apart = sides(reading, equality, weld)
    names = [link.name if link else "world" for link in (reading.links.get(one), reading.links.get(other))]
    if names[0] == names[1]:
        reading.note("left out", what, "both of its bodies are one here")
        return None
    if max(apart) > MAX_LOOP_GAP:
        text = "its two sides are apart at the reference pose, and joints here are closed from the start on"
        reading.note("left out", what, text, f"{1000 * apart[0]:.3g} mm, {apart[1]:.3g} rad")
        return None
    name = reading.names.give("joint", reading.name("equality", equality), "loop")
    ends = names if names[1] != "world" else names[::-1]
    table: dict[str, Any] = {"name": name, "between": ends, "fixed" if weld else "ball": {}}
    return {**table, "point": numbers(where)}


def sides(reading: ModelReading, equality: int, weld: bool) -> tuple[int, int, Array, tuple[float, float]]:
    """Return the two bodies, where they meet (3,) [m], and how far their sides are apart [m], [rad]."""
    model, data = reading.model, reading.data
    ids = int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])
    if int(model.eq_objtype[equality]) == int(reading.library.mjtObj.mjOBJ_SITE):
        points = [np.array(data.site_xpos[k]) for k in ids]
        axes = [np.array(data.site_xmat[k]).reshape(3, 3) for k in ids]
        bodies = tuple(int(model.site_bodyid[k]) for k in ids)
        tilt = angle(axes[0].T @ axes[1]) if weld else 0.0
        return bodies[0], bodies[1], points[0], (float(np.linalg.norm(points[0] - points[1])), tilt)
    numbers_of, places = np.array(model.eq_data[equality]), [np.array(data.xpos[k]) for k in ids]
    axes = [np.array(data.xmat[k]).reshape(3, 3) for k in ids]
    if not weld:
        points = [places[k] + axes[k] @ numbers_of[3 * k : 3 * k + 3] for k in (0, 1)]
        return ids[0], ids[1], points[0], (float(np.linalg.norm(points[0] - points[1])), 0.0)
    # of a weld: an anchor on the second, where the first is from there, and how it is turned
    anchor, place, turn = numbers_of[:3], numbers_of[3:6], numbers_of[6:10]
    where = places[1] + axes[1] @ anchor
    gap = float(np.linalg.norm(where - (places[0] + axes[0] @ place)))
    return ids[0], ids[1], where, (gap, angle((axes[0] @ matrix(turn)).T @ axes[1]))


def angle(axes: Any) -> float:
    """Return the angle [rad] of a rotation matrix."""
    return float(np.arccos(np.clip((np.trace(axes) - 1) / 2, -1, 1)))
