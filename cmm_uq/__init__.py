"""Uncertainty of coordinate measuring machines, and the certificates that state it."""

__version__ = "0.2.0"
