"""Definitions of the responses in a configuration."""

from collections.abc import Mapping
from typing import Any

from repose.apparatus import bench_tests
from repose.config.reading import get
from repose.core.responses import Definitions
from repose.core.targets import Targets


def definitions_of(config: Mapping[str, Any]) -> Definitions:
    """For each response of a study's bench tests the keys that define it, with their values.

    Other bench tests are left out: the study's files do not change with them.
    """
    used = Targets.of(config["targets"]).apparatus
    return {
        response.name: {key: get(config, key) for key in response.definition}
        for test in bench_tests()
        if test.name in used
        for response in test.responses
    }
