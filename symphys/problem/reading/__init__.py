"""From a path to parsed tables, and how faults of a file are collected and worded."""
