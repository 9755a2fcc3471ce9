"""What joints are: which motions of one body against another they lock, and what acts along those that they leave."""

from symphys.joints.ball import BALL
from symphys.joints.fixed import FIXED
from symphys.joints.hinge import HINGE
from symphys.joints.joint import Joint, Limits, Socket, Spring
from symphys.joints.kind import Coordinate, Kind, Placed
from symphys.joints.linkage import Link, Linkage, carriers, linkages, tree_joints
from symphys.joints.motor import Motor, Servo, TorqueMotor, VelocityMotor
from symphys.joints.slider import SLIDER
from symphys.joints.universal import UNIVERSAL

KINDS: dict[str, Kind] = {kind.name: kind for kind in (BALL, FIXED, HINGE, SLIDER, UNIVERSAL)}

__all__ = [
    "BALL",
    "FIXED",
    "HINGE",
    "KINDS",
    "SLIDER",
    "UNIVERSAL",
    "Coordinate",
    "Joint",
    "Kind",
    "Limits",
    "Link",
    "Linkage",
    "Motor",
    "Placed",
    "Servo",
    "Socket",
    "Spring",
    "TorqueMotor",
    "VelocityMotor",
    "carriers",
    "linkages",
    "tree_joints",
]
