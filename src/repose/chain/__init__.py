"""The main chain of the method, a module a stage: design, dataset, train, invert, validate."""
