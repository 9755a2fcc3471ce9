"""Robots of other programs in Python."""
