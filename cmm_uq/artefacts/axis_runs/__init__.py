"""Runs along axes, read by a laser interferometer, straightness or angular optics, a level or a straightedge."""
