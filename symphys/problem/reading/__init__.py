"""Parsed tables from a path, and the faults of a file with their wording."""
