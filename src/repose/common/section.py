"""Define the base class of a configuration's section, a model with typed fields.

A section is a subclass of `Section` with one field per key::

    class Drop(Section):
        seeds: int = Field(ge=1, le=100, description="runs of each sample")
        height_mm: float = Field(ge=1, le=1000, description="height of the fall")

The `description` explains the key. The message about a bad value states the allowed
values, which are the type and the bounds of the field, or the words of `Allowed`. The
tables of config/README.md are also made from the fields (`repose.config.page`). The
source of a value is given in ``json_schema_extra={"source": ...}``.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    model_validator,
)
from pydantic_core import PydanticCustomError, core_schema

AUTO: Final = "auto"
# Default of a key that may be missing from a file but must not be null.
ABSENT: Any = None
# Default of a key of the type `OrAuto`: its number is computed from other keys.
OF_OTHERS: Any = AUTO
# The number follows from other keys (`repose.config.computed`).
Auto = Literal["auto"]
T = TypeVar("T")
if TYPE_CHECKING:
    # A type checker sees a number, because stages read the key after it is computed.
    OrAuto = Annotated[T, AUTO]
else:

    class OrAuto:
        """The type of a key that may be `auto`, as ``OrAuto[float]``."""

        def __class_getitem__(cls, value: Any) -> Any:
            return value | Auto


# Pairs of a key and its allowed values, and the type of the error that holds them.
Contradictions = Iterator[tuple[str, str]]
CONTRADICTION = "contradiction"

# Paths without control characters, and without braces, which Snakemake reads as
# wildcards.
_NO_BRACES = r"^[^{}\x00-\x1f\x7f]+$"
# Marks the types of keys that name a file.
FILE: Final = object()


@dataclass(frozen=True)
class Allowed:
    """Words for the allowed values of a key, if type and bounds do not describe them.

    It is written ``Annotated[str, Field(pattern=...), Allowed("a colour")]``.
    """

    words: str

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """Add the words to the schema of the key."""
        return handler(schema) | {"allowed": self.words}


_Path = Annotated[str, Field(pattern=_NO_BRACES)]
Path = Annotated[_Path, Allowed("a path of a file, without braces"), FILE]
PathOrNull = Annotated[
    _Path | None, Allowed("a path of a file, without braces, or null"), FILE
]
MOST_BERRIES = 20_000
Berries = Annotated[int, Field(ge=1, le=MOST_BERRIES)]
Percent = Annotated[float, Field(gt=0, le=50)]
Seed = Annotated[int, Field(ge=0, le=4294967295)]
Seeds = Annotated[int, Field(ge=1, le=100)]
Share = Annotated[float, Field(ge=0, le=1)]


class Section(BaseModel):
    """Base class of a section, which refuses unknown keys and infinite numbers.

    Values are not converted, so true is not accepted as a number. There is one
    exception: a file may write a whole number as 8.0
    (`repose.common.faults.convert_whole_numbers`).
    """

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        strict=True,
        allow_inf_nan=False,
        defer_build=True,
        protected_namespaces=(),
    )

    def contradictions(self) -> Contradictions:
        """Find values that are valid alone but contradict each other.

        Yields
        ------
        tuple of str
            A key of this section and its allowed values. The base class yields nothing.
        """
        return iter(())

    @model_validator(mode="after")
    def _without_contradictions(self) -> Self:
        refuse(self.contradictions())
        return self


def refuse(contradictions: Iterable[tuple[str, str]]) -> None:
    """Raise the error with which a validator reports contradictions, if there are any.

    Parameters
    ----------
    contradictions : iterable of (str, str)
        For each contradiction, a key and its allowed values. The key "" stands for the
        whole section.

    Raises
    ------
    PydanticCustomError
        If there is any contradiction.
    """
    pairs = list(contradictions)
    if pairs:
        message = "values that do not go together"
        raise PydanticCustomError(CONTRADICTION, message, {"found": pairs})


class OneOf:
    """The type of a key whose value is a name from a registry.

    It is written ``Annotated[str, OneOf(names)]``. The function `names` is only called
    when the first configuration is checked, so the module of a section need not import
    the registry.
    """

    def __init__(self, names: Callable[[], Iterable[str]]) -> None:
        self.names = names

    def __get_pydantic_core_schema__(
        self, source: Any, handler: Any
    ) -> core_schema.CoreSchema:
        """Make pydantic's schema."""
        return core_schema.literal_schema(list(self.names()))


def _require_rising(numbers: Sequence[float]) -> Sequence[float]:
    """Return the numbers unchanged; raise ValueError unless they rise."""
    if not all(low < high for low, high in pairwise(numbers)):
        raise ValueError("the numbers do not rise")
    return numbers


# Marks a pair whose first number is below its second.
RISING = AfterValidator(_require_rising)
