"""Readers of the tables of a problem file, a module for each kind."""
