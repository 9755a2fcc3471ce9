"""One time step, as a branch-free casadi expression."""

from symphys.dynamics.functions import TracedStep, report_function, step_function, trace_step
from symphys.dynamics.joints.warm_start import components
from symphys.dynamics.observation.body_sensors import (
    accelerometer_bodies,
    accelerometers,
    body_quantities,
    body_quantity_names,
)
from symphys.dynamics.observation.joint_coordinates import (
    joint_quantities,
    joint_quantity_names,
    reading_function,
    readings,
)
from symphys.dynamics.observation.queries import gap_function, slip_function
from symphys.dynamics.tracing.recording import TracedCall, TracedVector

__all__ = [
    "TracedCall",
    "TracedStep",
    "TracedVector",
    "accelerometer_bodies",
    "accelerometers",
    "body_quantities",
    "body_quantity_names",
    "components",
    "gap_function",
    "joint_quantities",
    "joint_quantity_names",
    "reading_function",
    "readings",
    "report_function",
    "slip_function",
    "step_function",
    "trace_step",
]
