"""The time step as a list of small shared functions instead of one expression."""
