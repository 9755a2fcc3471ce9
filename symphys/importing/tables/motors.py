"""Actuators of a model as motors of joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from symphys.importing.tables.reading import HINGE, SLIDE, ModelReading, numbers

FIXED, AFFINE = 0, 1
"""MuJoCo's types of gains; of biases, NONE is 0 and AFFINE 1."""
INTEGRATOR, FILTER_EXACT = 1, 3
"""MuJoCo's types of activation: none is 0, and those beyond are not linear."""
Motor = dict[str, Any]
"""All keys of ``motor.affine``."""
FREE = [-np.inf, np.inf]
DEFAULTS = {"gain": 1.0, "offset": 0.0, "kp": 0.0, "kv": 0.0, "gear": 1.0, "command_range": FREE, "force_range": FREE}


def read_motors(reading: ModelReading, joints: list[dict[str, Any]]) -> None:
    """Puts motors into [[joint]] tables: those of actuators, and those that a URDF gives its joints."""
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
    """The one motor of a joint: that of its first actuator; what others give at command 0 is added.

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
    """The keys of ``motor.affine`` that differ from their defaults."""
    return {key: numbers(value) for key, value in law.items() if value != DEFAULTS[key]}


def target(reading: ModelReading, actuator: int) -> tuple[int, float] | None:
    """The joint that an actuator drives, and the gear between them."""
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
    if kind not in (int(types.mjTRN_JOINT), int(types.mjTRN_JOINTINPARENT)):
        reading.note("left out", what, "actuators at sites, bodies and slider-cranks have no counterpart")
        return None
    if reading.off("ACTUATION"):
        reading.note("left out", what, "the model's options switch actuators off")
        return None
    if model.jnt_type[index] not in (HINGE, SLIDE) or index not in reading.joint_names:
        reading.note("left out", what, "motors drive hinges and sliders that can move")
        return None
    return index, gear


def through_tendon(reading: ModelReading, tendon: int) -> tuple[int, float] | None:
    """The one joint that a fixed tendon moves, and its coefficient; None if there are several."""
    model = reading.model
    first, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
    wraps = range(first, first + count)
    if any(int(model.wrap_type[wrap]) != int(reading.library.mjtWrap.mjWRAP_JOINT) for wrap in wraps):
        return None
    moving = [wrap for wrap in wraps if model.wrap_prm[wrap]]
    return (int(model.wrap_objid[moving[0]]), float(model.wrap_prm[moving[0]])) if len(moving) == 1 else None


def affine(reading: ModelReading, actuator: int, joint: int, gear: float) -> Motor | None:
    """The law of an actuator; None for one that is not affine."""
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
    bias = bias if model.actuator_biastype[actuator] else np.zeros(3)
    # MuJoCo's length is gear times its coordinate, which is not 0 at the reference pose
    offset = float(bias[0] + bias[1] * gear * reading.reference(joint))
    law: Motor = {"gain": float(gain[0]), "offset": offset, "kp": -float(bias[1]), "kv": -float(bias[2]), "gear": gear}
    return {**law, "command_range": command, "force_range": force_range(reading, actuator, joint, gear)}


def force_range(reading: ModelReading, actuator: int, joint: int, gear: float) -> list[float]:
    """The least and the largest force before the gear: the actuator's own, within those of its joint."""
    model, ends = reading.model, [-np.inf, np.inf]
    if model.actuator_forcelimited[actuator]:
        ends = [float(end) for end in model.actuator_forcerange[actuator]]
    if model.jnt_actfrclimited[joint] and gear:
        own = sorted(float(end) / gear for end in model.jnt_actfrcrange[joint])
        ends = [max(ends[0], own[0]), min(ends[1], own[1])]
    return [ends[0], max(ends)]
