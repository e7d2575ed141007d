"""The configuration: reading, checks, and the cost of its run."""
