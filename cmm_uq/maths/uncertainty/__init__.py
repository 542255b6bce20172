"""Uncertainty of measurement: law of propagation (GUM), Monte Carlo (JCGM 101, 102), budgets, how results are stated.

The room knows nothing of machines, jobs or documents. It takes a measurement model (a function or a parsed expression),
its inputs with their distributions and correlations, and says what is known of the outputs. Import from its files.
"""
