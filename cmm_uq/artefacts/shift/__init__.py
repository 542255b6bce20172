"""Self-calibration by shifting: an axis, or two, from an uncalibrated artefact read in several places.

The machine's error and the artefact's own dimensions are found together; what no shift can tell apart is said.
"""
