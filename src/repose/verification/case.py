"""What a case of the verification suite gives back: results beside references, and the data of one plot."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

CLOSED = "closed form"
DIGITISED = "digitised, Chung & Ooi (2011)"
# Relative tolerances, the same for all cases.
CLOSED_TOLERANCE, DIGITISED_TOLERANCE = 0.003, 0.025

PASSED, MISSED, KNOWN, REPORTED = "passed", "MISSED", "known deviation", "reported"


@dataclass(frozen=True)
class Row:
    """One number of a case beside its reference."""

    quantity: str
    unit: str
    reference: object
    source: str
    result: float
    deviation: float | None
    tolerance: float | None
    status: str
    note: str = ""

    @property
    def passed(self) -> bool:
        """False only for a row that misses its tolerance without a reason known beforehand."""
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
    """A result that has to agree with a reference."""
    if tolerance is None:
        tolerance = DIGITISED_TOLERANCE if source.startswith("digitised") else CLOSED_TOLERANCE
    deviation = abs(result - reference) / abs(scale or reference)
    status = PASSED if deviation <= tolerance else KNOWN if known else MISSED
    note = known if status == KNOWN else ""
    return Row(quantity, unit, reference, source, result, deviation, tolerance, status, note)


def at_most(quantity: str, unit: str, result: float, limit: float, source: str) -> Row:
    """A result that must not exceed a limit."""
    status = PASSED if result <= limit else MISSED
    return Row(quantity, unit, f"at most {limit:.7g}", source, result, None, None, status)


def within(quantity: str, unit: str, result: float, low: float, high: float, source: str) -> Row:
    """A result that has to lie in a published range."""
    status = PASSED if low <= result <= high else MISSED
    return Row(quantity, unit, f"{low:g} to {high:g}", source, result, None, None, status)


def reported(
    quantity: str, unit: str, result: float, note: str, reference: float | str = "", source: str = ""
) -> Row:
    """A result that is shown and not judged; with a number as reference its deviation too."""
    deviation = None
    if isinstance(reference, float) and reference != 0.0:
        deviation = abs(result - reference) / abs(reference)
    return Row(quantity, unit, reference, source, result, deviation, None, REPORTED, note)


@dataclass(frozen=True)
class Curve:
    """A line of a plot; reference curves are drawn as lines, results as markers unless `line`."""

    label: str
    x: object
    y: object
    reference: bool = False
    line: bool = False
    error: object = None


@dataclass(frozen=True)
class Panel:
    """One pair of axes."""

    x_label: str
    y_label: str
    curves: tuple
    log_x: bool = False


@dataclass(frozen=True)
class Result:
    """A case: its title, what is compared with what, rows and the panels of its plot."""

    title: str
    compared: str
    rows: list
    panels: list = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """Whether no row misses."""
        return all(row.passed for row in self.rows)


@dataclass(frozen=True)
class Effort:
    """How much work the statistical cases do; FULL is what the verb does."""

    hits: int = 10_000
    berries: int = 400
    seeds: int = 2
    pile: tuple | None = None
    laws: Mapping[str, Any] = field(default_factory=dict)

    @property
    def tension(self) -> str:
        """How a contact ends."""
        return self.laws.get("tension", "keep")


FULL = Effort()
