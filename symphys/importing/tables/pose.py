"""The reference pose of a model, and the start of a robot: coordinates of a keyframe, within limits, on the ground."""

from __future__ import annotations

from typing import Any

import numpy as np

from symphys.importing.records import ImportProblem
from symphys.importing.tables.reading import BALL, FREE, HINGE, SLIDE, ModelReading, numbers
from symphys.suggest import hint

PLANE = 0
"""MuJoCo's type of a geom that is a plane."""
MAX_LIFTS = 3
"""Times that a robot is lifted out of the ground; once is enough unless MuJoCo could not list all contacts."""
MAX_SUNK_DEPTH = 1e-4
"""[m] Overlap with the ground that stays."""


def keyframe(library: Any, model: Any, name: str | None, file: str) -> int | None:
    """Return the index of a keyframe by its name or number; ImportProblem if there is none."""
    if name is None:
        return None
    names = [library.mj_id2name(model, library.mjtObj.mjOBJ_KEY, k) or str(k) for k in range(model.nkey)]
    if name not in names:
        raise ImportProblem(file, f"there is no keyframe {name!r}; {hint(name, names)}", "keyframe")
    return names.index(name)


def reference_pose(library: Any, model: Any, key: int | None) -> Any:
    """Return MjData with hinges and sliders at 0, and floating bodies and balls as in the keyframe."""
    data = library.MjData(model)
    data.qpos[:] = model.qpos0
    if key is not None:
        for joint in range(model.njnt):
            start = int(model.jnt_qposadr[joint])
            size = {FREE: 7, BALL: 4}.get(int(model.jnt_type[joint]), 0)
            data.qpos[start : start + size] = model.key_qpos[key][start : start + size]
    place(library, model, data)
    return data


def place(library: Any, model: Any, data: Any) -> None:
    """Move bodies to where the coordinates say."""
    library.mj_kinematics(model, data)
    library.mj_comPos(model, data)


def range_of(reading: ModelReading, joint: int) -> tuple[float, float]:
    """Return the limits of a hinge or slider, relative to the reference pose; infinite where there are none."""
    model = reading.model
    if not model.jnt_limited[joint] or reading.off("LIMIT"):
        return -np.inf, np.inf
    low, high = (float(end) - reading.reference(joint) for end in model.jnt_range[joint])
    return low, high


def starts(reading: ModelReading) -> dict[int, float]:
    """Return the start of hinges and sliders relative to the reference pose: the keyframe's, within their limits."""
    model, found = reading.model, dict[int, float]()
    for joint in range(model.njnt):
        if model.jnt_type[joint] not in (HINGE, SLIDE):
            continue
        low, high = range_of(reading, joint)
        found[joint] = min(max(wanted(reading, joint), low), high)
    return found


def at_start(reading: ModelReading) -> Any:
    """Return MjData at the start, with its contacts."""
    library, model = reading.library, reading.model
    data = library.MjData(model)
    data.qpos[:] = reading.data.qpos
    for joint, value in starts(reading).items():
        data.qpos[int(model.jnt_qposadr[joint])] += value
    place(library, model, data)
    library.mj_collision(model, data)
    return data


def lift(reading: ModelReading) -> None:
    """Lift floating robots that begin below the ground onto it."""
    model, lifted = reading.model, dict[int, float]()
    for _ in range(MAX_LIFTS):
        data, depths = at_start(reading), dict[int, float]()
        for contact in data.contact:
            joint = sunk(reading, data, contact)
            if joint is not None:
                depths[joint] = max(depths.get(joint, 0.0), -float(contact.dist))
        if not depths:
            break
        for joint, depth in depths.items():
            reading.data.qpos[int(model.jnt_qposadr[joint]) + 2] += depth
            lifted[joint] = lifted.get(joint, 0.0) + depth
        place(reading.library, model, reading.data)
    for joint, depth in lifted.items():
        name = reading.name("body", int(model.jnt_bodyid[joint])) or str(joint)
        text = "the model begins below the ground; it is lifted onto it"
        reading.note("approximated", f"start of {name}", text, f"{1e3 * depth:.3g} mm")


def sunk(reading: ModelReading, data: Any, contact: Any) -> int | None:
    """Return the free joint of a robot that has sunk into a level plane; None for other contacts."""
    model = reading.model
    for one, other in ((contact.geom1, contact.geom2), (contact.geom2, contact.geom1)):
        level = min(one, other) >= 0 and model.geom_type[one] == PLANE and data.geom_xmat[one][8] > 1 - 1e-9
        if level and contact.dist < -MAX_SUNK_DEPTH:
            root = int(model.body_rootid[model.geom_bodyid[other]])
            joint = int(model.body_jntadr[root])
            return joint if joint >= 0 and model.jnt_type[joint] == FREE else None
    return None


def begin(reading: ModelReading, joints: list[dict[str, Any]]) -> None:
    """Put the start into the tables of joints, and note keyframes and velocities that are lost."""
    model, by_name = reading.model, {table["name"]: table for table in joints}
    moved, furthest = [], 0.0
    for joint, value in starts(reading).items():
        table = by_name.get(reading.joint_names.get(joint, ""))
        if table is None:
            continue
        start = numbers(value)
        if start:
            table["start"] = start
        off = abs(value - wanted(reading, joint))
        if off > 1e-9:
            moved.append(f"{table['name']} at {start:.4g}")
            furthest = max(furthest, off)
    if moved:
        text = "the model begins beyond their limits, so they begin at these: " + ", ".join(moved)
        reading.note("approximated", f"start of {len(moved)} joints", text, f"up to {furthest:.3g} rad or m")
    if reading.key is None and model.nkey:
        names = ", ".join(reading.name("key", k) or str(k) for k in range(model.nkey))
        text = "it begins at the model's reference pose; the option keyframe chooses one of them"
        reading.note("left out", f"keyframes {names}", text)
    if reading.key is not None and np.any(model.key_qvel[reading.key]):
        what = f"velocities of keyframe {reading.name('key', reading.key) or reading.key}"
        reading.note("left out", what, "it begins at rest", f"{np.abs(model.key_qvel[reading.key]).max():g}")


def wanted(reading: ModelReading, joint: int) -> float:
    """Return the coordinate at which the model itself begins, relative to the reference pose."""
    if reading.key is None:
        return 0.0
    at = int(reading.model.jnt_qposadr[joint])
    return float(reading.model.key_qpos[reading.key][at]) - reading.reference(joint)
