"""Lengths along lines: what step gauges and gauge blocks share."""
