"""Articulated bodies: kinematic trees in generalized coordinates, mass matrix, forward kinematics and dynamics."""
