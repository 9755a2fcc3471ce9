"""What can be computed from a state without taking a step: sensors, coordinates of joints, queries."""
