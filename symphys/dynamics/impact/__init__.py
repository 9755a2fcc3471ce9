"""Impacts: no time passes, only velocities change."""
