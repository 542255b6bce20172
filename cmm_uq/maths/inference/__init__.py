"""Compares observations with a model: least squares by orthogonal factorisation, and posteriors by emcee.

This room knows linear models, priors and samples; it knows nothing of coordinate measuring machines.
"""
