"""What the numbers of an examination mean: findings with levels, in words.

It knows numbers and texts alone: runs judge with it, the command line and the pages tell it.
"""
