"""What formulas take of whole motions."""
