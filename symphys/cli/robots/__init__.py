"""Commands on robots of other programs."""
