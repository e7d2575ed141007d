"""Definitions of the responses in a configuration, and settings of their bench tests."""

from collections.abc import Mapping
from typing import Any

from repose.apparatus import bench, bench_tests
from repose.config import stands_on
from repose.config.reading import get
from repose.core.responses import Definitions, Response, derived
from repose.core.targets import Targets

CHOSEN = "measure.response"  # chooses one of several definitions of a response
GRAIN = "berry_height_mm"


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


def described(config: Mapping[str, Any], response: Response, berry: Mapping[str, Any]) -> dict[str, Any]:
    """Definition of a response and settings of its bench test, with the units in the keys.

    `definition` holds its `name` and `settings`, the keys that it reads; `bench` the keys of the bench test's section
    that a run reads. The grain's height comes from `berry`, the result of the verb `berry`, if the configuration has
    none.
    """
    from repose.measure.settings import MeasureSettings

    chosen, test = response, bench(response.apparatus)
    if CHOSEN in chosen.definition:
        own = {other.name: other for other in test.responses}
        chosen = own[derived(chosen.name, get(config, CHOSEN))]
    settings = {key.rpartition(".")[2]: get(config, key) for key in chosen.definition}
    if GRAIN in settings:
        height = MeasureSettings.of(config["measure"], berry).berry_height_mm
        settings[GRAIN] = None if height is None else float(f"{height:.6g}")
    section = stands_on.pouring(config, test.name)[test.name]
    return {
        "definition": {"name": chosen.label, "settings": settings},
        "bench": {key: section[key] for key in test.settings.model_fields if key in section},
    }
