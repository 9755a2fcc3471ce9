"""Rotations and smoothed primitives for casadi types."""
