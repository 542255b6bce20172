"""Reads a job folder (job.toml and the recordings it names), checks it, and makes typed objects.

Nothing after this room parses text. Whatever is unknown, missing or contradictory is an error that names file, line or key.
"""
