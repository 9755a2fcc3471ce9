"""Programs: a rollout as calls of small functions on a flat memory."""
