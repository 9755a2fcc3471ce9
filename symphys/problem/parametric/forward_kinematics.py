"""Forward kinematics of the start: where joints with a ``start`` put the bodies of the file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from symphys.model.joints.start import moved_to_start, spanning_tree, unmoved
from symphys.problem.parametric.joints import ParametricJoint
from symphys.problem.reading.faults import Faults
from symphys.types import Array


def forward_kinematics(
    joints: Sequence[ParametricJoint], initial: Mapping[str, Array], faults: Faults
) -> dict[str, Array]:
    """The state at the start with every joint at its ``start``; see ``Problem.initial`` and ``moved_to_start``.

    Args:
        joints: all joints; their frames are where the bodies lie in the file.
        initial: the state as the file has it.
        faults: collects starts of a joint that is compliant, or closes a loop of joints with a start.
    """
    if not any(joint.start for joint in joints):
        return {name: value.copy() for name, value in initial.items()}
    tree = spanning_tree(joints)
    for index, joint in enumerate(joints):
        reason = unmoved(joint, tree) if joint.start else ""
        if reason:
            key = "start" if faults.data["joint"][index].get("start") is not None else "start_deg"
            text = f"this joint {reason}, so it begins where the other joints put it; leave this out"
            faults.add(("joint", index, key), text)
    return moved_to_start(joints, initial)
