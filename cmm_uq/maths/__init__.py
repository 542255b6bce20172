"""Geometry, uncertainty and inference; knows no coordinate measuring machine."""
