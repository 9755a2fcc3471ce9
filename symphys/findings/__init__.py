"""What the numbers of an examination mean: findings with levels, in words.

It depends on numbers and texts alone: runs judge with it; the command line and the pages show it.
"""
