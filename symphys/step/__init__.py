"""One time step, as a branch-free casadi expression."""

from symphys.step.function import Recording, record_step, report_function, step_function
from symphys.step.probe import gap_function, slip_function
from symphys.step.record import Piece, Slot

__all__ = [
    "Piece",
    "Recording",
    "Slot",
    "gap_function",
    "record_step",
    "report_function",
    "slip_function",
    "step_function",
]
