"""How a configuration defines the responses."""

from collections.abc import Mapping
from typing import Any

from repose.apparatus import bench_tests
from repose.config.reading import get
from repose.core.responses import Definitions


def definitions_of(config: Mapping[str, Any]) -> Definitions:
    """Definitions of the responses of a configuration's bench tests.

    Parameters
    ----------
    config : mapping

    Returns
    -------
    mapping
        For each response the keys that define it, with their values.
    """
    return {
        one.name: {key: get(config, key) for key in one.definition}
        for test in bench_tests()
        if test.name in config
        for one in test.responses
    }
