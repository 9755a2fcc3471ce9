"""What can be computed from a state without taking a step: sensors, coordinates of joints, queries."""

from symphys.dynamics.observation.ball_turns import joint_turn
from symphys.dynamics.observation.body_sensors import (
    accelerometer_bodies,
    accelerometers,
    body_quantities,
    body_quantity_names,
)
from symphys.dynamics.observation.half_step import half_step_function
from symphys.dynamics.observation.joint_coordinates import (
    joint_quantities,
    joint_quantity_names,
    named_readings,
    reading_function,
    readings,
)
from symphys.dynamics.observation.queries import gap_function, slip_function
from symphys.dynamics.observation.sites import site_quantities, site_quantity_names

__all__ = [
    "accelerometer_bodies",
    "accelerometers",
    "body_quantities",
    "body_quantity_names",
    "gap_function",
    "half_step_function",
    "joint_quantities",
    "joint_quantity_names",
    "joint_turn",
    "named_readings",
    "reading_function",
    "readings",
    "site_quantities",
    "site_quantity_names",
    "slip_function",
]
