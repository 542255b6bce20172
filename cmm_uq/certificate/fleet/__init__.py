"""The page of a fleet of machines: their factors beside each other, and what they have in common."""
