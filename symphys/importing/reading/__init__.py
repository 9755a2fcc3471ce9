"""From a file to a compiled model: its text is checked, MuJoCo reads it in a process of its own, losses are mended."""
