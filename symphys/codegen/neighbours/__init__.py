"""Kernels of many bodies: loops over bodies and over the pairs that are near in a step."""
