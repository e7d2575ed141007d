"""Searches on a surrogate."""
