"""Compute products of vectors, each given as three separate numbers."""

from .jit import inlined


@inlined
def dot(ax, ay, az, bx, by, bz):
    """Return the scalar product a . b of two vectors a and b."""
    return ax * bx + ay * by + az * bz


@inlined
def squared_length(x, y, z):
    """Return the square of the length of a vector (x, y, z)."""
    return x * x + y * y + z * z


@inlined
def cross(ax, ay, az, bx, by, bz):
    """Return the vector product a x b of two vectors a and b."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
