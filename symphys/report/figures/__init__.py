"""Figures of one quantity each, as SVG by matplotlib."""
