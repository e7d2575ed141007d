"""The bench tests, built from the engine: build, run, measure.

Importing this package makes their responses known (`repose.core.responses`); the engine is loaded when a test runs.
"""

from repose.apparatus import responses

NAMES = ("funnel", "drum")

__all__ = ["NAMES", "responses"]
