"""Shapes whose distance is known everywhere, and what balls and capsules do at them: one module a shape."""
