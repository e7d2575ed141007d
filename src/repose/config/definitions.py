"""How a configuration defines the responses."""

from collections.abc import Mapping
from typing import Any

from repose.apparatus import bench_tests
from repose.config.reading import get
from repose.core.responses import Definitions


def definitions_of(config: Mapping[str, Any]) -> Definitions:
    """For each response of the bench tests in a configuration the keys that define it, with their values."""
    return {
        one.name: {key: get(config, key) for key in one.definition}
        for test in bench_tests()
        if test.name in config
        for one in test.responses
    }
