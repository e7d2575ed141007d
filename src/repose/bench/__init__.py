"""The bench tests: each one a module that is registered by name, and what they share.

Importing this package makes all bench tests and their responses known. It loads neither the engine nor what measures
pictures; these are loaded when a bench test runs.
"""

# The line that registers each bench test, in the order in which they are listed.
from repose.bench import funnel, drum, cylinder, discharge, turning  # noqa: F401, isort: skip
from repose.bench import lifted_cylinder, inclined_plane, drop_test, drawdown  # noqa: F401, isort: skip
from repose.bench.bench_test import (
    BenchTest,
    Run,
    Scene,
    bench,
    bench_of,
    bench_tests,
    names,
    register,
)

__all__ = [
    "BenchTest",
    "Run",
    "Scene",
    "bench",
    "bench_of",
    "bench_tests",
    "names",
    "register",
]
