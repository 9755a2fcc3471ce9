"""Model predictive control: a plan at every tick from the measured state, and the closed loop with a plant."""

from symphys.mpc.closed_loop import ClosedLoop, close_loop, record_of, write_closed_loop
from symphys.mpc.controller import Controller
from symphys.mpc.planner import RecedingPlan
from symphys.mpc.plant import Plant

__all__ = ["ClosedLoop", "Controller", "Plant", "RecedingPlan", "close_loop", "record_of", "write_closed_loop"]
