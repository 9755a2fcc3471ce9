"""Fits: Levenberg-Marquardt on the arrow matrix of shared and own numbers, losses, noise, horizons, starts."""
