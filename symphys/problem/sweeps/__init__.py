"""Sweeps: keys of a problem that take several values, each combination or sample a problem of its own."""
