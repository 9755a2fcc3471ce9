"""However far coordinates go, bodies are placed so that all joints fit, at those coordinates."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from worlds.contacts import numbers
from worlds.linkage import chain, hanging

from symphys.dynamics.articulated.forward_kinematics import final_poses, joint_starts
from symphys.dynamics.collision.predicted_path import PredictedPath
from symphys.dynamics.joints.joint_frames import joint_frames_at
from symphys.maths import rotation
from symphys.model.joints import kinematic_trees

ANGLES, TURNS = [0.3, -0.5, 0.2], [1.1, -2.0, 0.7]


def test_joints_fit_where_the_coordinates_lead() -> None:
    world, values, zero = chain(3), hanging(3, ANGLES), ca.SX.zeros(3)
    poses = [
        (ca.SX(np.array(values[f"b{k}.position"], float)), ca.SX(np.array(values[f"b{k}.orientation"], float)))
        for k in range(3)
    ]
    (tree,) = kinematic_trees(world.joints)
    joints = [world.joints[link.joint] for link in tree.links if link.joint is not None]
    paths = [PredictedPath(p, rotation.matrix(q), zero, zero, zero, zero, ca.SX(0), None, None) for p, q in poses]
    starts = joint_starts(tree, joints, paths)
    found = final_poses(tree, joints, starts, [p for p, _ in poses], [ca.SX([turn]) for turn in TURNS])
    after = [(each.position, rotation.multiply(each.turn, q)) for each, (_, q) in zip(found, poses, strict=True)]
    for joint in world.joints:
        before, now = (
            joint_frames_at(joint, tuple(places[i] for i in joint.bodies)).placed(ca.SX(0)) for places in (poses, after)
        )
        assert numbers(joint.kind.errors(now)) == pytest.approx(0, abs=1e-12)
        (coordinate,) = joint.kind.coordinates
        turned = float(numbers(coordinate.value(now) - coordinate.value(before)))
        assert np.exp(1j * turned) == pytest.approx(np.exp(1j * TURNS[joint.first]))
