"""The fit: Levenberg-Marquardt on the arrow of shared and own numbers, losses, noise, horizons, other starts."""
