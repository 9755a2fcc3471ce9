"""Contact constraints: their preparation, the projection of their impulses, the distribution of loads."""
