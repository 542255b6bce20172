"""Budgets of coordinate metrology: sphere, scale, ballbar, temperature, triangle, test and use of a machine."""
