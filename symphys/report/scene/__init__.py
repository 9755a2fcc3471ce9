"""Pictures of a motion: what moves, what stands around it, from which side it is seen."""
