"""Samples of scenarios: numbers and poses that are drawn, behind z in the vector of a kernel."""
