"""Steps of many equal bodies: recorded for a few, computed for all that are near each other."""
