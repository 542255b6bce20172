"""Figures of performance, and decisions: whether a machine is within its limits, and how sure that is."""
