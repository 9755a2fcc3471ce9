"""From a file to a compiled model: the text is checked, MuJoCo reads it in its own process, losses are repaired."""
