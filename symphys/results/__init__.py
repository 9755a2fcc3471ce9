"""What a run folder holds: the fields of its files, as they are written and as they are read."""
