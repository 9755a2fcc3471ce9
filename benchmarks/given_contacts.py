"""Crocoddyl's derivatives of a step with contacts given: milliseconds of CPU time a step, one thread.

    python benchmarks/given_contacts.py robot.xml dt [elbow ...]

A floating base with a torque for each joint; under each elbow the foot is held to the ground, three numbers of force.
Derivatives are analytic; contacts and dynamics are as Crocoddyl has them, without friction and without impacts. It runs
in a process and an environment of its own, since its wheels only fit libraries of their time:

    pip install crocoddyl==3.2.0 "cmeel-urdfdom<5" "cmeel-tinyxml2<11"

(3.2.1 with pin 4.1.0 reads freed memory in its bindings: its accelerations are not numbers.) Prints what was measured.
"""

from __future__ import annotations

import sys
from time import process_time

import crocoddyl
import numpy as np
import pinocchio

STEPS, TURNS, FOOT, BENT = 32, 9, 0.3, -0.9
"""Steps of a turn; turns, of which the fastest counts; [m] from an elbow to its foot; [rad] elbows."""


def main(path: str, dt: str, *elbows: str) -> None:
    """Time one action model."""
    model = pinocchio.buildModelFromMJCF(path)
    action = held_step(model, float(dt), elbows)
    data = action.createData()
    x, u = np.concatenate([pinocchio.neutral(model), np.zeros(model.nv)]), np.zeros(action.nu)
    for name in elbows:  # straight legs cannot move their feet up or down
        x[model.joints[model.getJointId(name)].idx_q] = BENT
    best = np.inf
    for _ in range(TURNS):
        began = process_time()
        for _ in range(STEPS):
            action.calc(data, x, u)
            action.calcDiff(data, x, u)
        best = min(best, (process_time() - began) / STEPS)
    assert np.isfinite(data.Fx).all()
    assert data.Fx.any()
    print(f"Crocoddyl, {action.state.ndx} numbers, {len(elbows)} contacts given;{best}")


def held_step(model: pinocchio.Model, dt: float, elbows: tuple[str, ...]) -> crocoddyl.IntegratedActionModelEuler:
    """One semi-implicit step of a robot whose feet are held."""
    foot = pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, -FOOT]))
    kind = pinocchio.FrameType.OP_FRAME
    frames = [model.addFrame(pinocchio.Frame(f"{name}_foot", model.getJointId(name), 0, foot, kind)) for name in elbows]
    state = crocoddyl.StateMultibody(model)
    actuation = crocoddyl.ActuationModelFloatingBase(state)
    contacts = crocoddyl.ContactModelMultiple(state, actuation.nu)
    axes = pinocchio.LOCAL_WORLD_ALIGNED
    held = [crocoddyl.ContactModel3D(state, frame, np.zeros(3), axes, actuation.nu, np.zeros(2)) for frame in frames]
    for name, contact in zip(elbows, held, strict=True):
        contacts.addContact(name, contact)
    costs = crocoddyl.CostModelSum(state, actuation.nu)
    dynamics = crocoddyl.DifferentialActionModelContactFwdDynamics(state, actuation, contacts, costs, 0.0, True)
    return crocoddyl.IntegratedActionModelEuler(dynamics, dt)


if __name__ == "__main__":
    main(*sys.argv[1:])
