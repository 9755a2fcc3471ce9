"""Findings with levels, in words, from the numbers of an examination.

It depends on numbers and texts alone: runs judge with it; the command line and the pages show it.
"""
