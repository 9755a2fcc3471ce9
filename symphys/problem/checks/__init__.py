"""Whether a problem can be computed: sizes, masses, memory, overlaps at the start."""
