"""Ballbar: two balls a fixed distance apart."""
