"""The rows of a verification case: results beside references."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

CLOSED = "closed form"
DIGITISED = "digitised, Chung & Ooi (2011)"
# Relative tolerances, the same for all cases.
CLOSED_TOLERANCE, DIGITISED_TOLERANCE = 0.003, 0.025

PASSED, MISSED, KNOWN, REPORTED = "passed", "MISSED", "known deviation", "reported"


@dataclass(frozen=True)
class Row:
    """A result of a case beside its reference."""

    quantity: str
    unit: str
    reference: object  # a number; a text for an interval, or empty without a reference
    source: str  # of the reference
    result: float  # of the simulator
    deviation: (
        float | None
    )  # relative to the reference, or to a given scale; None if not computed
    tolerance: (
        float | None
    )  # largest allowed deviation; None if the deviation is not judged
    status: str  # PASSED, MISSED, KNOWN or REPORTED
    note: str = ""  # why the row misses or is not judged

    @property
    def passed(self) -> bool:
        """False only for a row that misses its tolerance without a known reason."""
        return self.status != MISSED


def close(
    quantity: str,
    unit: str,
    result: float,
    reference: float,
    source: str = CLOSED,
    tolerance: float | None = None,
    scale: float | None = None,
    known: str = "",
) -> Row:
    """Compare a result with a reference; an expected miss, with its reason `known`, is not a failure."""
    if tolerance is None:
        tolerance = (
            DIGITISED_TOLERANCE if source.startswith("digitised") else CLOSED_TOLERANCE
        )
    deviation = abs(result - reference) / abs(scale or reference)
    status = PASSED if deviation <= tolerance else KNOWN if known else MISSED
    note = known if status == KNOWN else ""
    return Row(
        quantity, unit, reference, source, result, deviation, tolerance, status, note
    )


def at_most(quantity: str, unit: str, result: float, limit: float, source: str) -> Row:
    """Compare a result with a limit that it must not exceed."""
    status = PASSED if result <= limit else MISSED
    return Row(
        quantity, unit, f"at most {limit:.7g}", source, result, None, None, status
    )


def within(
    quantity: str, unit: str, result: float, low: float, high: float, source: str
) -> Row:
    """Compare a result with a published range."""
    status = PASSED if low <= result <= high else MISSED
    return Row(
        quantity, unit, f"{low:g} to {high:g}", source, result, None, None, status
    )


def reported(
    quantity: str,
    unit: str,
    result: float,
    note: str,
    reference: float | str = "",
    source: str = "",
) -> Row:
    """Show a result without judging it; with a number as reference the row has a deviation too."""
    has_number = isinstance(reference, float) and reference != 0.0
    deviation = (
        abs(result - float(reference)) / abs(float(reference)) if has_number else None
    )
    return Row(
        quantity, unit, reference, source, result, deviation, None, REPORTED, note
    )


Rows = Iterator[Row]  # of a case


@dataclass(frozen=True)
class Effort:
    """Size of the statistical cases; FULL is the size of the verb."""

    hits: int = 10_000  # impacts of each kind in the energy cases
    berries: int = 400  # in the poured packing
    laws: Mapping[str, Any] = field(
        default_factory=dict
    )  # force laws of every case, for `Simulation`

    @property
    def tension(self) -> str:
        """Tension at the end of a contact."""
        return self.laws.get("tension", "keep")


FULL = Effort()
