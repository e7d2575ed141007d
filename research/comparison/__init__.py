"""Comparisons of each part of the method with its alternatives, at equal budgets."""
