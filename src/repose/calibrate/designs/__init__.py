"""Designs of experiments: Latin hypercubes, and textbook designs with analyses."""
