"""Included files: found, renamed, merged, placed."""
