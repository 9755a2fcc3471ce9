"""Which numbers of a world a phase may set: those that no shape, mass or place of a joint follows from.

Forces of constraints act as impulses at the start of a step, which cover half of the step before too. So numbers of
two kinds change at the start of a step: those that count from there on, and those that bound or make such impulses.
"""

from __future__ import annotations

from symphys.model.joints import TorqueMotor
from symphys.problem.parametric.world import ParametricWorld

CONTACT = ("friction", "restitution")
JOINT = ("gain", "offset", "velocity", "range", "torque", "kp", "kv", "stiffness", "damping", "rest", "friction")
LAGGED = ("friction", "torque", "kp", "kv", "stiffness", "damping", "rest")
"""What bounds or makes impulses of constraints; but the largest torque of a torque motor bounds its command."""


def changing(parametric: ParametricWorld) -> list[str]:
    """The parameters that a phase may set."""
    joints = {joint.name for joint in parametric.joints}
    found = []
    for name in parametric.parameters():
        owner, _, key = name.rpartition(".")
        if name == "gravity" or key in (JOINT if owner in joints else CONTACT):
            found.append(name)
    return found


def lagged(parametric: ParametricWorld, name: str) -> bool:
    """Whether a parameter that a phase sets acts through impulses that cover half of the step before."""
    owner, _, key = name.rpartition(".")
    if key == "torque":
        return not any(joint.name == owner and isinstance(joint.motor, TorqueMotor) for joint in parametric.joints)
    return key in LAGGED
