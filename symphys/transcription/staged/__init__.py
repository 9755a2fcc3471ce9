"""A problem step by step: tangents of states, and how steps change them."""
