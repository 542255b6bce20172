"""Distances from stations of a tracking interferometer to a reflector on the ram (multilateration)."""
