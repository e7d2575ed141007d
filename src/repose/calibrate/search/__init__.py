"""Searches on a surrogate: the optimiser (`miga`), its objective and its archive (`objective`)."""
