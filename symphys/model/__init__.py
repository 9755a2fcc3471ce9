"""The world as data: bodies, shapes, static surfaces, contact laws, joints, controllers, the state layout.

    from symphys.model import Body, Hinge, Law, Plane, Servo, make_world

These names build worlds in Python; each module is imported when a name of it is first used.
"""

from typing import TYPE_CHECKING

from symphys.later import later

if TYPE_CHECKING:
    from symphys.model.body import Body
    from symphys.model.heightfield import Heightfield
    from symphys.model.joints import (
        AffineMotor,
        BallJoint,
        FixedJoint,
        HelicalJoint,
        Hinge,
        Servo,
        Slider,
        Spring,
        TorqueMotor,
        UniversalJoint,
        VelocityMotor,
    )
    from symphys.model.shapes import Box, Capsule, Convex, Cylinder, Ellipsoid, Fixture, Plane, Sphere, Terrain
    from symphys.model.state_layout import Layout, initial_state
    from symphys.model.world import Law, Scheme, World, make_world

__all__ = [
    "AffineMotor",
    "BallJoint",
    "Body",
    "Box",
    "Capsule",
    "Convex",
    "Cylinder",
    "Ellipsoid",
    "FixedJoint",
    "Fixture",
    "Heightfield",
    "HelicalJoint",
    "Hinge",
    "Law",
    "Layout",
    "Plane",
    "Scheme",
    "Servo",
    "Slider",
    "Sphere",
    "Spring",
    "Terrain",
    "TorqueMotor",
    "UniversalJoint",
    "VelocityMotor",
    "World",
    "initial_state",
    "make_world",
]

__getattr__ = later(
    __name__,
    {
        "body": ("Body",),
        "heightfield": ("Heightfield",),
        "joints": (
            "AffineMotor",
            "BallJoint",
            "FixedJoint",
            "HelicalJoint",
            "Hinge",
            "Servo",
            "Slider",
            "Spring",
            "TorqueMotor",
            "UniversalJoint",
            "VelocityMotor",
        ),
        "shapes": ("Box", "Capsule", "Convex", "Cylinder", "Ellipsoid", "Fixture", "Plane", "Sphere", "Terrain"),
        "state_layout": ("Layout", "initial_state"),
        "world": ("Law", "Scheme", "World", "make_world"),
    },
)
