"""Curves that the page's own script draws, from numbers that the page holds compressed."""
