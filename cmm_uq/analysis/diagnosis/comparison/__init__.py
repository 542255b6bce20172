"""Candidates for what a model leaves out, and their posterior probabilities."""
