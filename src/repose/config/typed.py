"""A configuration as typed sections, each made when it is first read: its other sections may still have faults."""

from collections.abc import Mapping
from functools import cache
from typing import Any

from pydantic import TypeAdapter, ValidationError

from repose.common.errors import raise_together
from repose.common.section import Section
from repose.config import faults, models
from repose.config.keys import Origin


def sections(
    config: Mapping[str, Any],
    source: str | Origin = "configuration",
    model: type[Section] | None = None,
) -> models.StudySettings:
    """Return the sections; reading one with faults raises InputError with all of them."""
    made: Any = _Sections(config, source, model or models.settings_type())
    return made


class _Sections:
    def __init__(
        self, config: Mapping[str, Any], source: str | Origin, model: type[Section]
    ) -> None:
        self._given = config, source, model

    def __getattr__(self, name: str) -> Any:
        config, source, model = self._given
        field = model.model_fields.get(name)
        if field is None:
            raise AttributeError(name)
        try:
            is_given = name in config or field.is_required()
            value: Any = field.get_default(call_default_factory=True)
            value = (
                _type(model, name).validate_python(config.get(name))
                if is_given
                else value
            )
        except ValidationError:
            raise_together(
                one
                for one in faults.check(config, source, model).faults
                if one.key.startswith(name)
            )
            raise
        self.__dict__[name] = value
        return value


@cache
def _type(model: type[Section], name: str) -> TypeAdapter[Any]:
    """Return what makes a section, or a key outside sections, typed."""
    return TypeAdapter(model.model_fields[name].annotation)  # type: ignore[arg-type]
