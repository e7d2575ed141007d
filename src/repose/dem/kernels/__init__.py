"""The inner loops of the engine: functions of floats and arrays, compiled by numba.

`rows` explains the tiles in which contacts and bodies lie, `state` lists the arrays of a
simulation, and `engine` makes a time step of all the other modules. Most kernels take
the arrays of `state` as arguments and write them in place.
"""
