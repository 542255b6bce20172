"""Plane surface, probed with a radius that is to be known."""
