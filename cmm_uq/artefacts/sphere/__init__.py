"""Test sphere, probed all around."""
