"""Functions of a state that take no step: sensors, coordinates of joints, queries."""

from symphys.dynamics.observation.joint_coordinates import joint_readings, joint_turn, reading_function, readings
from symphys.dynamics.observation.queries import gap_function, half_step_function, slip_function
from symphys.dynamics.observation.sensor_kind import MjcfSensor, SensedState, SensorKind
from symphys.dynamics.observation.sensors import SENSOR_KINDS, NamedSensor, named_sensors, sensor_readings

__all__ = [
    "SENSOR_KINDS",
    "MjcfSensor",
    "NamedSensor",
    "SensedState",
    "SensorKind",
    "gap_function",
    "half_step_function",
    "joint_readings",
    "joint_turn",
    "named_sensors",
    "reading_function",
    "readings",
    "sensor_readings",
    "slip_function",
]
