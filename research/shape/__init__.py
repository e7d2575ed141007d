"""Particle, tension, filling and definition of the angle beside the published piles."""
