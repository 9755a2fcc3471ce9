"""A problem step by step: tangents of states, and derivatives of steps in them."""
