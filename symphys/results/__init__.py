"""What a run folder holds: one definition of each of its files, which writers and readers import."""
