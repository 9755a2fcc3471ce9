"""One module for each optimisation method."""
