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
    """One number of a case beside its reference.

    Attributes
    ----------
    quantity, unit : str
        What it is.
    reference : float or str
        A number; a text where there is none, or an interval.
    source : str
        Of the reference.
    result : float
        What the simulator gives.
    deviation : float or None
        Of the result from the reference, relative unless the reference is zero.
    tolerance : float or None
        Largest deviation allowed; None where nothing is asserted.
    status : str
        One of `PASSED`, `MISSED`, `KNOWN`, `REPORTED`.
    note : str
        Why a row misses or is not asserted.
    """

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
    """A result that has to agree with a reference.

    Parameters
    ----------
    quantity, unit, source : str
        See `Row`.
    result, reference : float
        The two numbers.
    tolerance : float, optional
        0.3 % for a closed form and 2.5 % for a digitised value, unless given.
    scale : float, optional
        What the difference is divided by; the reference unless given.
    known : str
        Why the row is known to miss: it is then shown with its deviation and not counted as a failure.

    Returns
    -------
    Row
        Passed, missed, or known to deviate; the deviation is that of the two numbers over `scale`.
    """
    if tolerance is None:
        tolerance = DIGITISED_TOLERANCE if source.startswith("digitised") else CLOSED_TOLERANCE
    deviation = abs(result - reference) / abs(scale or reference)
    status = PASSED if deviation <= tolerance else KNOWN if known else MISSED
    note = known if status == KNOWN else ""
    return Row(quantity, unit, reference, source, result, deviation, tolerance, status, note)


def at_most(quantity: str, unit: str, result: float, limit: float, source: str) -> Row:
    """A result that must not exceed a limit.

    Parameters
    ----------
    quantity, unit : str
        Name and unit of the result.
    result, limit : float
        The two numbers, in that unit.
    source : str
        Of the limit.

    Returns
    -------
    Row
        Passed or missed; without a deviation.
    """
    status = PASSED if result <= limit else MISSED
    return Row(quantity, unit, f"at most {limit:.7g}", source, result, None, None, status)


def within(quantity: str, unit: str, result: float, low: float, high: float, source: str) -> Row:
    """A result that has to lie in a published range.

    Parameters
    ----------
    quantity, unit : str
        Name and unit of the result.
    result, low, high : float
        The number and the ends of the range, in that unit.
    source : str
        Of the range.

    Returns
    -------
    Row
        Passed or missed; without a deviation.
    """
    status = PASSED if low <= result <= high else MISSED
    return Row(quantity, unit, f"{low:g} to {high:g}", source, result, None, None, status)


def reported(
    quantity: str, unit: str, result: float, note: str, reference: float | str = "", source: str = ""
) -> Row:
    """A result that is shown and not judged; with a number as reference its deviation too.

    Parameters
    ----------
    quantity, unit : str
        Name and unit of the result.
    result : float
    note : str
        Shown beside the result.
    reference : float or str, optional
    source : str, optional
        Of the reference.

    Returns
    -------
    Row
        Neither passed nor missed.
    """
    deviation = None
    if isinstance(reference, float) and reference != 0.0:
        deviation = abs(result - reference) / abs(reference)
    return Row(quantity, unit, reference, source, result, deviation, None, REPORTED, note)


@dataclass(frozen=True)
class Curve:
    """A line of a plot; reference curves are drawn as lines, results as markers unless `line`.

    Attributes
    ----------
    label : str
        In the legend.
    x, y : array_like, (N,)
        In the units of the panel's labels.
    reference : bool
        Whether it is what the results are compared with.
    line : bool
        Whether a result is drawn as a line.
    error : array_like, (N,), or None
        Half lengths of the error bars of y.
    """

    label: str
    x: object
    y: object
    reference: bool = False
    line: bool = False
    error: object = None


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Attributes
    ----------
    x_label, y_label : str
        With the units.
    curves : tuple of Curve
        In the order of the legend.
    log_x : bool
        Whether x is on a logarithmic scale.
    """

    x_label: str
    y_label: str
    curves: tuple
    log_x: bool = False


@dataclass(frozen=True)
class Result:
    """A case: its title, what is compared with what, rows and the panels of its plot.

    Attributes
    ----------
    title : str
        Of the case.
    compared : str
        What is compared with what.
    rows : list of Row
        The numbers.
    panels : list of Panel
        Of the plot; none where nothing is drawn.
    """

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
    """How much work the statistical cases do; FULL is what the verb does.

    Attributes
    ----------
    hits : int
        Impacts of each kind in the energy cases.
    berries : int
        In the poured packing.
    seeds : int
        Runs of each time step in the convergence case.
    pile : tuple or None
        What these runs need: configuration, particle, moduli; None for no runs.
    laws : mapping
        The force laws of every case: tension, contact_law and rolling_law of `repose.dem.Simulation`.
    """

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
