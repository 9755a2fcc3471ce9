"""Model predictive control: a plan at every tick from what is measured, and the closed loop with a plant."""
