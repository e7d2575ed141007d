"""Searches on a surrogate: the optimiser (`miga`), and what it minimises and keeps (`objective`)."""
