"""The bench tests: each one a module that is registered by name, and what they share.

Importing this package makes all bench tests and their responses known. It loads neither
the engine's kernels nor what measures pictures; these are loaded when a bench test runs.
"""

# Each import registers a bench test. They are listed in this order, the funnel first.
from repose.bench import funnel  # noqa: F401, isort: skip
from repose.bench import drum  # noqa: F401, isort: skip
from repose.bench import cylinder  # noqa: F401, isort: skip
from repose.bench import discharge  # noqa: F401, isort: skip
from repose.bench import turning  # noqa: F401, isort: skip
from repose.bench import lifted_cylinder  # noqa: F401, isort: skip
from repose.bench import inclined_plane  # noqa: F401, isort: skip
from repose.bench import drop_test  # noqa: F401, isort: skip
from repose.bench import drawdown  # noqa: F401, isort: skip
from repose.bench.bench_test import (
    BenchTest,
    Run,
    bench,
    bench_of,
    bench_tests,
    names,
    register,
)
from repose.bench.scene import Scene

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
