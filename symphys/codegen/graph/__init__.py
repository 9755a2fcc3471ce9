"""Expression graphs of small functions: instructions, adjoints, rewriting."""
