"""The main chain of the method, one module per stage: design, dataset, train, invert, validate."""
