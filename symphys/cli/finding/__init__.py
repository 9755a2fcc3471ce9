"""Commands that find runs again: list them, take the best, compare two, and roll one out again."""
