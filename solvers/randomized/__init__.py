"""Optimisation over samples of a scenario: batches, aggregated gradients, validation."""
