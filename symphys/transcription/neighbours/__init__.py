"""Rollouts of many bodies: programs of loops, and what evaluates them."""
