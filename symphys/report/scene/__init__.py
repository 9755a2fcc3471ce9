"""Pictures of a motion: moving bodies, static surfaces, and the views of both."""
