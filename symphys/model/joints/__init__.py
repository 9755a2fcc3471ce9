"""What joints are: which motions of one body against another they lock, and what acts along those that they leave."""

from symphys.model.joints.ball import BALL
from symphys.model.joints.coupling import CouplingSpec, JointCoupling
from symphys.model.joints.fixed import FIXED
from symphys.model.joints.hinge import HINGE
from symphys.model.joints.joint import Joint, JointFrame, Limits, Spring
from symphys.model.joints.kind import Coordinate, Kind, PlacedFrames
from symphys.model.joints.kinematic_tree import KinematicTree, Link, carriers, kinematic_trees, tree_joints
from symphys.model.joints.motor import AffineMotor, Motor, Servo, TorqueMotor, VelocityMotor, given_torque
from symphys.model.joints.slider import SLIDER
from symphys.model.joints.specs import BallJoint, FixedJoint, Hinge, JointSpec, MovingJoint, Slider, UniversalJoint
from symphys.model.joints.universal import UNIVERSAL

KINDS: dict[str, Kind] = {kind.name: kind for kind in (BALL, FIXED, HINGE, SLIDER, UNIVERSAL)}

__all__ = [
    "BALL",
    "FIXED",
    "HINGE",
    "KINDS",
    "SLIDER",
    "UNIVERSAL",
    "AffineMotor",
    "BallJoint",
    "Coordinate",
    "CouplingSpec",
    "FixedJoint",
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
    "kinematic_trees",
    "tree_joints",
]
