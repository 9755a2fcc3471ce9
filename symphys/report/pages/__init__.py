"""HTML pages: of a run, of a batch, of a motion."""
