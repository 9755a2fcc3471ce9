"""Inference from a fit: intervals, bootstrap, unidentifiable directions, residual analysis."""
