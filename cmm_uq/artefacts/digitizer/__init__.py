"""Laser digitizer on the ram: where its mount lies, from scans of the reference sphere in several attitudes."""
