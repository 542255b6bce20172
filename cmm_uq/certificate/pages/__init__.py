"""Pages about machines and budgets that are no certificates."""
