"""What one may believe of a fit: intervals, bootstrap, directions that are open, what is left."""
