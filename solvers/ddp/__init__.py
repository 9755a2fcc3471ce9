"""Differential dynamic programming: a backward pass along the steps of a motion, and motions by its feedback."""
