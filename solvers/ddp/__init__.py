"""Differential dynamic programming: a backward pass along the steps of a motion, and rollouts under its feedback."""
