"""One time step, as a branch-free casadi expression."""

from symphys.step.coordinates import joint_quantities, joint_quantity_names, reading_function, readings
from symphys.step.function import Recording, record_step, report_function, step_function
from symphys.step.holding import components
from symphys.step.probe import gap_function, slip_function
from symphys.step.record import Piece, Slot
from symphys.step.senses import accelerometer_bodies, accelerometers, body_quantities, felt_names

__all__ = [
    "Piece",
    "Recording",
    "Slot",
    "accelerometer_bodies",
    "accelerometers",
    "body_quantities",
    "components",
    "felt_names",
    "gap_function",
    "joint_quantities",
    "joint_quantity_names",
    "reading_function",
    "readings",
    "record_step",
    "report_function",
    "slip_function",
    "step_function",
]
