"""Joints of a model as [[joint]] tables, with frames between several joints of one body, and their couplings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from symphys.importing.tables.links import frame_table
from symphys.importing.tables.pose import range_of
from symphys.importing.tables.reading import BALL, FREE, HINGE, SLIDE, ModelReading, WeldedLink, numbers
from symphys.model.gimbal import Screw, locks

ROTOR, LEAST_ROTOR = 0.1, 1e-6
"""The armature that is added against gimbal lock: a share of a body's largest moment of inertia, at least [kg m^2]."""
PARALLEL = 1e-9
"""Largest deviation of the cosine between the axes of a screw's two joints from 1."""


def read_joints(reading: ModelReading) -> tuple[dict[int, list[dict[str, Any]]], list[dict[str, Any]]]:
    """(frames before each link, by its top body; [[joint]] tables)."""
    frames, joints = dict[int, list[dict[str, Any]]](), list[dict[str, Any]]()
    found = threads(reading)
    for top, link in reading.links.items():
        if top == link.top:
            frames[top], more = chain(reading, link, found)
            joints += more
    return frames, joints


@dataclass(frozen=True)
class Thread:
    """A slide that follows a hinge about the same axis: indices of joints and of the equality, ``pitch`` [m]."""

    hinge: int
    slide: int
    equality: int
    pitch: float


def threads(reading: ModelReading) -> list[Thread]:
    """Find the screws of a model: a hinge and a slide tied by an equality, with nothing else on the slide."""
    model, found = reading.model, list[Thread]()
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
        if next_to and abs(cosine) > 1 - PARALLEL and not burdened(reading, slide, equality):
            lead = float(ratio if types[0] == SLIDE else 1 / ratio) * np.sign(cosine)
            found.append(Thread(hinge, slide, equality, 2 * np.pi * lead))
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
    reading: ModelReading, link: WeldedLink, found: Sequence[Thread]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Make the frames and joints from the parent of a link to it; ``found``: the screws of the model."""
    pitches, slides = {each.hinge: each.pitch for each in found}, {each.slide for each in found}
    model, indices = reading.model, [k for k in reading.joints_of(link.top) if k not in slides]
    free = [j for j in indices if model.jnt_type[j] == FREE]
    for joint in free:
        reading.joint_names[joint] = link.name
        floating(reading, joint, link)
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
        carried = max(ROTOR * float(np.max(model.body_inertia[link.top])), LEAST_ROTOR)
        joints[0]["armature"] = numbers(carried)
        text = "axes of several joints of one body can come together, where frames without mass have no inertia"
        reading.note("approximated", f"armature of {reading.called('joint', indices[0])}", text, f"{carried:.3g}")
    if parent is not None and len(indices) > 1:
        reading.apart.append((parent.name, link.name))
    return frames, joints


def read_couplings(reading: ModelReading) -> list[dict[str, Any]]:
    """Make the [[coupling]] tables, of the equality constraints of coordinates."""
    model, found = reading.model, list[dict[str, Any]]()
    screws = [each.equality for each in threads(reading)]
    for equality in (k for k in range(model.neq) if k not in screws):
        if int(model.eq_type[equality]) == int(reading.library.mjtEq.mjEQ_JOINT) and reading.holds(equality):
            table = coupling(reading, equality)
            found += [table] if table else []
    reading.rigid += len(found) + len(screws)
    return found


def coupling(reading: ModelReading, equality: int) -> dict[str, Any] | None:
    """A coordinate that follows another; both are 0 at the reference pose, in MuJoCo too."""
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
    """The top body of the link from which all others of its tree hang."""
    link = reading.links[body]
    above = reading.links.get(int(reading.model.body_parentid[link.top]))
    return link.top if above is None else root_of(reading, above.top)


def screws_of(reading: ModelReading, joint: int, pitch: float) -> list[Screw]:
    """Return the coordinates of a joint at the reference pose; ``pitch`` [m] of a screw."""
    model, point = reading.model, np.array(reading.data.xanchor[joint], float)
    carried = bool(model.dof_armature[int(model.jnt_dofadr[joint])])
    if model.jnt_type[joint] == BALL:
        return [Screw(axis, point, carried=carried) for axis in np.eye(3)]
    axis, slides = np.array(reading.data.xaxis[joint], float), model.jnt_type[joint] == SLIDE
    low, high = range_of(reading, joint)
    return [Screw(axis, None if slides else point, low, high, carried, pitch / (2 * np.pi))]


def floating(reading: ModelReading, joint: int, link: WeldedLink) -> None:
    """What MuJoCo lets act on a free joint and a floating body here has not."""
    model, dof = reading.model, int(reading.model.jnt_dofadr[joint])
    acting = {
        "armature": model.dof_armature[dof : dof + 6],
        "damping": model.dof_damping[dof : dof + 6],
        "friction": model.dof_frictionloss[dof : dof + 6],
        "stiffness": np.array([model.jnt_stiffness[joint]]),
    }
    for key, values in acting.items():
        if np.any(np.asarray(values)):
            text = "a body that floats has none"
            reading.note("left out", f"{key} of the free {reading.called('joint', joint)}", text, f"{np.max(values):g}")


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
        ball(reading, joint, dof)
        return table
    if friction and not reading.off("FRICTIONLOSS"):
        table["friction"] = numbers(friction)
    spring = spring_of(reading, joint, dof)
    if spring:
        table["spring"] = spring
    limits = limits_of(reading, joint)
    if limits:
        table["limits"] = limits
    return table


def ball(reading: ModelReading, joint: int, dof: int) -> None:
    """What acts in a ball joint of MuJoCo and not in one here."""
    model = reading.model
    acting = {
        "damping": float(model.dof_damping[dof]),
        "friction": float(model.dof_frictionloss[dof]),
        "stiffness": float(model.jnt_stiffness[joint]),
        "limit": float(model.jnt_limited[joint]),
    }
    for key, value in acting.items():
        if value:
            text = "a ball joint has no coordinates along which it could act"
            reading.note("left out", f"{key} of {reading.called('joint', joint)}", text, f"{value:g}")


def spring_of(reading: ModelReading, joint: int, dof: int) -> dict[str, float]:
    """Stiffness and damping; the rest is where the spring gives nothing, from the reference pose."""
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


def limits_of(reading: ModelReading, joint: int) -> list[float] | None:
    """The limits, measured from the reference pose; None where there are none."""
    low, high = range_of(reading, joint)
    return numbers([low, high]) if isfinite(low) or isfinite(high) else None
