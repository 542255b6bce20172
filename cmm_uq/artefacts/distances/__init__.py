"""Distances between two balls: what a ballbar and a Bryan gauge share."""
