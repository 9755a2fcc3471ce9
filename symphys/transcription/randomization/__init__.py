"""Samples of scenarios: random numbers and poses, placed after z in the vector of a kernel."""
