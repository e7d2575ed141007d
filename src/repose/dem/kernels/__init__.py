"""The inner loops: pure functions of floats and arrays, compiled by numba."""
