"""Joints: the relative motions of two bodies that they lock, and what acts along those that they leave."""

from symphys.model.joints.ball import BALL, BallJoint
from symphys.model.joints.coupling import CouplingSpec, JointCoupling
from symphys.model.joints.fixed import FIXED, FixedJoint
from symphys.model.joints.helical import HelicalJoint, helical
from symphys.model.joints.hinge import HINGE, Hinge
from symphys.model.joints.joint import Joint, JointFrame, Limits, Spring
from symphys.model.joints.kind import Coordinate, Kind, PlacedFrames
from symphys.model.joints.kinematic_tree import KinematicTree, Link, carriers, kinematic_trees, tree_joints
from symphys.model.joints.motor import AffineMotor, Motor, Servo, TorqueMotor, VelocityMotor, given_torque
from symphys.model.joints.slider import SLIDER, Slider
from symphys.model.joints.specs import JointSpec, MovingJoint
from symphys.model.joints.universal import UNIVERSAL, UniversalJoint

KINDS: dict[str, Kind] = {kind.name: kind for kind in (BALL, FIXED, HINGE, SLIDER, UNIVERSAL)}
"""Kinds without numbers of their own, by name."""
JOINTS: dict[str, type[JointSpec]] = {
    "ball": BallJoint,
    "hinge": Hinge,
    "slider": Slider,
    "helical": HelicalJoint,
    "universal": UniversalJoint,
    "fixed": FixedJoint,
}
"""Descriptions of all kinds, by their names in problem files."""

__all__ = [
    "BALL",
    "FIXED",
    "HINGE",
    "JOINTS",
    "KINDS",
    "SLIDER",
    "UNIVERSAL",
    "AffineMotor",
    "BallJoint",
    "Coordinate",
    "CouplingSpec",
    "FixedJoint",
    "HelicalJoint",
    "Hinge",
    "Joint",
    "JointCoupling",
    "JointFrame",
    "JointSpec",
    "Kind",
    "KinematicTree",
    "Limits",
    "Link",
    "Motor",
    "MovingJoint",
    "PlacedFrames",
    "Servo",
    "Slider",
    "Spring",
    "TorqueMotor",
    "UniversalJoint",
    "VelocityMotor",
    "carriers",
    "given_torque",
    "helical",
    "kinematic_trees",
    "tree_joints",
]
