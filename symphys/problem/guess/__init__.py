"""Guesses of a motion: what they may name, how they move between what is known, the [guess] table, recordings."""
