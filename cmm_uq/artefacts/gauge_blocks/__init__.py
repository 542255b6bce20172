"""Gauge blocks: the two faces of each."""
