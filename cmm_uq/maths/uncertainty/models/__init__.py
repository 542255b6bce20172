"""Measurement models and budgets in TOML files."""
