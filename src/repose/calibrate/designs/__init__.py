"""Designs of experiments: Latin hypercubes and the designs of textbooks, with their analyses."""
