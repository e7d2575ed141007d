"""A response in words: its definition, and the settings of its bench test."""

from collections.abc import Mapping
from functools import reduce
from typing import Any

from repose.apparatus import bench
from repose.core.responses import Response, derived

CHOSEN = "measure.response"  # names the definition of a response that has several
GRAIN = "berry_height_mm"


def described(config: Mapping[str, Any], response: Response, berry: Mapping[str, Any]) -> dict[str, Any]:
    """Definition of a response and settings of its bench test, with the units in the keys."""
    from repose.measure.settings import MeasureSettings

    one, test = response, bench(response.apparatus)
    section, others = config[test.name], ("seeds", *test.measured_by)
    if CHOSEN in one.definition:
        own = {other.name: other for other in test.responses}
        one = own[derived(one.name, value_of(config, CHOSEN))]
    settings = {key.rpartition(".")[2]: value_of(config, key) for key in one.definition}
    if GRAIN in settings:
        height = MeasureSettings.of(config["measure"], berry).berry_height_mm
        settings[GRAIN] = None if height is None else float(f"{height:.6g}")
    return {
        "definition": {"name": one.label, "settings": settings},
        "bench": {
            key: section[key] for key in test.settings.model_fields if key in section and key not in others
        },
    }


def value_of(config: Mapping[str, Any], key: str) -> Any:
    """Value of a dotted key."""
    return reduce(lambda section, name: section[name], key.split("."), config)
