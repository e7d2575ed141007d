"""Search on a surrogate: the optimiser, its objective and its archive."""
