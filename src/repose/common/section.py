"""A section of the configuration as a typed model.

A section is a subclass of `Section` with one field a key::

    class Drop(Section):
        seeds: int = Field(ge=1, le=100)
        height_mm: float = Field(ge=1, le=1000)

The message about a bad value states the allowed values: the `description` of the field, or its type and bounds.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError, core_schema

AUTO: Final = "auto"
ABSENT: Any = None  # default of a key that may be left out, and may not be null
OF_OTHERS: Any = AUTO  # default of a key of the type `OrAuto`
Auto = Literal["auto"]  # the number follows from other keys (`repose.config.computed`)
T = TypeVar("T")
if TYPE_CHECKING:
    OrAuto = Annotated[T, AUTO]
else:

    class OrAuto:
        """The type of a key that may be `auto`; once the configuration is resolved it is the number."""

        def __class_getitem__(cls, value: Any) -> Any:
            return value | Auto


Contradictions = Iterator[tuple[str, str]]  # (key, allowed values)

CONTRADICTION = "contradiction"  # type of the error that holds `Contradictions`

_NO_BRACES = r"^[^{}\x00-\x1f\x7f]+$"  # snakemake takes braces for wildcards
FILE: Final = object()  # marks the types of keys that name a file
Path = Annotated[
    str, Field(pattern=_NO_BRACES, description="a path of a file, without braces"), FILE
]
_Path = Annotated[str, Field(pattern=_NO_BRACES)]
PathOrNull = Annotated[
    _Path | None, Field(description="a path of a file, without braces, or null"), FILE
]
Seed = Annotated[int, Field(ge=0, le=4294967295)]
Share = Annotated[float, Field(ge=0, le=1)]
Percent = Annotated[float, Field(gt=0, le=50)]
Seeds = Annotated[int, Field(ge=1, le=100)]
MOST_BERRIES = 20_000
Berries = Annotated[int, Field(ge=1, le=MOST_BERRIES)]


class Section(BaseModel):
    """A section: all keys known, no value converted; 8.0 is not an integer, true not a number; numbers are finite."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        strict=True,
        allow_inf_nan=False,
        defer_build=True,
        protected_namespaces=(),
    )

    def contradictions(self) -> Contradictions:
        """Find values, each valid by itself, that contradict each other; the key is relative to this section."""
        return iter(())

    @model_validator(mode="after")
    def _without_contradictions(self) -> Self:
        refuse(self.contradictions())
        return self


def refuse(contradictions: Iterable[tuple[str, str]]) -> None:
    """Raise the error by which a validator reports `Contradictions`, if any; the key "" means the whole value."""
    pairs = list(contradictions)
    if pairs:
        raise PydanticCustomError(
            CONTRADICTION, "values that do not go together", {"found": pairs}
        )


class OneOf:
    """The type of a key that takes a name of a registry, as ``Annotated[str, OneOf(names)]``.

    `names` is called when the first configuration is checked, so that a module with a section loads no registry.
    """

    def __init__(self, names: Callable[[], Iterable[str]]) -> None:
        self.names = names

    def __get_pydantic_core_schema__(
        self, source: Any, handler: Any
    ) -> core_schema.CoreSchema:
        return core_schema.literal_schema(list(self.names()))


def _rising(numbers: Sequence[float]) -> Sequence[float]:
    """Check that numbers rise; ValueError if they do not."""
    if not all(low < high for low, high in pairwise(numbers)):
        raise ValueError("the numbers do not rise")
    return numbers


RISING = AfterValidator(_rising)  # marks a pair whose first number is below its second
