"""The bench tests, each a module that is registered by name, and their common parts.

The import of this package registers all bench tests and their responses. It imports
neither the kernels of the engine nor the measurement of pictures. These are imported
when a bench test runs.
"""

# Each import registers a bench test. The order of the imports is that of all lists.
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
