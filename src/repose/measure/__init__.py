"""Measurements: from a picture or a simulated pile to numbers."""
