"""The command for measured motions."""
