"""Tests of when machines are calibrated again."""
