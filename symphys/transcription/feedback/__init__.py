"""Sensors and controllers along a rollout."""
