"""The inner loops of the engine: functions of floats and arrays, compiled by numba.

`rows` explains the tiles in which contacts and bodies are stored, `state` lists the
arrays of a simulation, and `engine` combines the other modules into a time step. Most
kernels take the arrays of `state` as arguments and change them in place.
"""
