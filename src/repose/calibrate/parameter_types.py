"""Check the entries of the section `parameters`, one by one and together."""

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from repose.calibrate.constraints import CONSTRAINT_EXAMPLE, CONSTRAINT_FORM, Constraint
from repose.calibrate.parameter_space import (
    PRIOR_HALF_WIDTH_SDS,
    Limits,
    ParameterSpace,
    find_range,
)
from repose.calibrate.scales import LINEAR, LOG, SCALES
from repose.common.errors import did_you_mean
from repose.common.section import Allowed, Contradictions, refuse

ENTRY_KEYS = ("fixed", "prior", "range", "scale")
# Smallest fraction of the ranges that constraints may allow. A design is made of all
# points of a larger design that are allowed, so a smaller fraction would make it too
# slow.
MIN_ALLOWED_FRACTION = 0.05
# A range with more decades is too wide for a linear scale.
MAX_LINEAR_DECADES = 2.0
# Smallest width of a range, as a fraction of its larger end. A narrower one would be
# lost in rounding errors.
MIN_RELATIVE_WIDTH = 1e-9
# Smallest width of a range whose ends are about 0, where a fraction means nothing.
MIN_WIDTH = 1e-30


class _ParameterBounds:
    """Check of the entries of a parameter whose values lie between two bounds.

    Attributes
    ----------
    low, high : float
        The bounds.
    is_bounded : bool
        Whether the upper bound is smaller than the largest float.
    number, allowed : str
        Descriptions of an allowed number and of an allowed entry, for error messages.
    """

    def __init__(self, low: float, high: float) -> None:
        self.low = low
        self.high = high
        self.is_bounded = high < sys.float_info.max
        within = f" from {low:g} to {high:g}" if self.is_bounded else ""
        self.number = f"a number{within}"
        self.allowed = (
            f"a pair [low, high] of numbers{within} with low < high; "
            "or fixed; or range with scale; or prior with mean and sd"
        )

    def check(self, entry: Any) -> Any:
        """Return an entry of the section unchanged, or raise an error if it is invalid."""
        if isinstance(entry, Mapping):
            refuse(self._find_errors(entry))
        elif not self._is_valid_range(entry):
            refuse([("", self.allowed)])
        return entry

    def _is_within_bounds(self, value: Any) -> bool:
        """Return whether a value is a number within the bounds."""
        return _is_number(value) and bool(self.low <= value <= self.high)

    def _is_valid_range(self, value: Any) -> bool:
        """Return whether a value is a pair of increasing numbers within the bounds.

        The numbers must differ by more than rounding errors.
        """
        if not isinstance(value, list | tuple) or len(value) != 2:
            return False
        low, high = value
        if not (self._is_within_bounds(low) and self._is_within_bounds(high)):
            return False
        smallest_width = MIN_RELATIVE_WIDTH * max(abs(low), abs(high))
        return bool(high - low > max(MIN_WIDTH, smallest_width))

    def _find_errors(self, entry: Mapping[str, Any]) -> Contradictions:
        """Find the errors of an entry that is a section.

        A valid entry has the key `fixed` alone, a range with a scale, or a prior with
        or without a range and a scale.

        Parameters
        ----------
        entry : mapping
            The entry, as the user wrote it.

        Yields
        ------
        pair of str
            The wrong key, and what is allowed. The key is empty if the entry as a whole
            is wrong.
        """
        unknown_keys = [str(key) for key in entry if key not in ENTRY_KEYS]
        for key in unknown_keys:
            hint = (
                did_you_mean(key, ENTRY_KEYS) or f"; keys here: {', '.join(ENTRY_KEYS)}"
            )
            yield key, f"a known key{hint}"

        # An entry with a fixed value has no other keys.
        if "fixed" in entry:
            if len(entry) > 1:
                yield "", "fixed alone, or prior with or without range"
            elif not self._is_within_bounds(entry["fixed"]):
                yield "fixed", self.number
            return

        # A range without a prior or a scale must be written as a plain pair.
        if "range" in entry and not {"prior", "scale"} & set(entry):
            yield (
                "",
                "a pair [low, high]; the key range needs a prior or a scale beside it",
            )
            return

        # Otherwise, the entry must be a prior, or a range with a scale.
        prior = entry.get("prior")
        is_range_acceptable = "range" not in entry or self._is_valid_range(
            entry["range"]
        )
        is_complete = prior is not None or {"range", "scale"} <= set(entry)
        is_wrong_as_a_whole = not is_complete or not is_range_acceptable
        # A misspelt key may be the reason why the entry is incomplete. It was reported
        # above, so do not report the entry as a whole, too.
        if is_wrong_as_a_whole and not unknown_keys:
            yield "", self.allowed
            return
        if prior is not None:
            yield from self._find_prior_error(prior)
        if is_range_acceptable:
            yield from self._find_scale_error(entry)

    def _find_scale_error(self, entry: Mapping[str, Any]) -> Contradictions:
        """Yield the key and what is allowed if the scale is unknown or does not fit."""
        scale = entry.get("scale", LINEAR)
        if not isinstance(scale, str) or scale not in SCALES:
            yield "scale", " or ".join(SCALES)
        elif scale == LOG and not ("range" in entry and entry["range"][0] > 0):
            yield "range", f"a pair [low, high] with low above 0, where scale is {LOG}"

    def _find_prior_error(self, prior: Any) -> Contradictions:
        """Yield the key and what is allowed for the first error of a prior, if any.

        The mean must be a number within the bounds. The standard deviation must be
        above 0, and not above the upper bound, which is infinite in practice unless
        `is_bounded`.
        """
        if not isinstance(prior, Mapping) or set(prior) != {"mean", "sd"}:
            yield "prior", "a section with the keys mean and sd"
        elif not self._is_within_bounds(prior["mean"]):
            yield "prior", f"a mean that is {self.number}"
        elif not (_is_number(prior["sd"]) and 0 < prior["sd"] <= self.high):
            limit = f" and up to {self.high:g}" if self.is_bounded else ""
            yield "prior", f"an sd above 0{limit}"


def _is_number(value: object) -> bool:
    """Return whether a value is a number; the values true and false are not."""
    return isinstance(value, int | float) and not isinstance(value, bool)


# A constraint has two sides with a sign in between. `Constraint.parse` reads the sides.
_ConstraintText = Annotated[
    str,
    Field(pattern=r"^[^<>=]+[<>]=[^<>=]+$"),
    Allowed(f"{CONSTRAINT_FORM} {CONSTRAINT_EXAMPLE}"),
]
Constraints = Annotated[
    tuple[_ConstraintText, ...],
    Field(strict=False, min_length=1),
    Allowed(f"a list: {CONSTRAINT_FORM} {CONSTRAINT_EXAMPLE}"),
]


def make_parameter_type(low: float, high: float) -> Any:
    """Make the type of a parameter: a range, a fixed value, or a prior.

    Parameters
    ----------
    low, high : float
        Bounds of all its values.
    """
    bounds = _ParameterBounds(low, high)
    kinds: Any = {"anyOf": [{"type": "array"}, {"type": "object"}]}
    return Annotated[
        Any,
        AfterValidator(bounds.check),
        Field(json_schema_extra=kinds),
        Allowed(bounds.allowed),
    ]


def find_far_priors(parameters: Mapping[str, Any]) -> Contradictions:
    """Find parameters whose range is far from their prior.

    A range is far if no value in it is within `PRIOR_HALF_WIDTH_SDS` standard
    deviations of the mean of the prior.

    Parameters
    ----------
    parameters : mapping
        The section `parameters`, whose entries are valid.

    Yields
    ------
    pair of str
        Name of the parameter, and the ranges that are allowed.
    """
    for name, entry in parameters.items():
        if not isinstance(entry, Mapping) or not {"prior", "range"} <= set(entry):
            continue
        mean = entry["prior"]["mean"]
        half_width = PRIOR_HALF_WIDTH_SDS * entry["prior"]["sd"]
        prior_low = mean - half_width
        prior_high = mean + half_width
        range_low, range_high = entry["range"]
        if prior_high < range_low or prior_low > range_high:
            yield (
                name,
                f"a range that overlaps {prior_low:g} to {prior_high:g}, which is "
                f"{PRIOR_HALF_WIDTH_SDS:g} sd about the mean of its prior",
            )


def describe_wide_ranges(parameters: Mapping[str, Any]) -> Iterator[str]:
    """Describe each parameter whose range is too wide for a linear scale.

    Fixed parameters are left out. Parameters whose entry names a scale are left out,
    too, because the user has chosen the scale. Ranges that begin at or below 0 are left
    out as well, because a logarithmic scale is impossible for them.

    Parameters
    ----------
    parameters : mapping
        The section `parameters`, whose entries are valid.

    Yields
    ------
    str
        A sentence about the parameter that proposes a remedy.
    """
    for name, entry in parameters.items():
        if isinstance(entry, Mapping) and ("scale" in entry or "fixed" in entry):
            continue
        low, high = find_range(name, entry)
        if low <= 0:
            continue
        decades = math.log10(high / low)
        if decades > MAX_LINEAR_DECADES:
            yield (
                f"{name}: its range {low:g} to {high:g} spans {decades:.1f} decades, and "
                f"most samples lie in the highest; write "
                f"{{range: [{low:g}, {high:g}], scale: log}} to spread them evenly over "
                "the decades, or scale: linear to keep the range as it is"
            )


def find_constraint_errors(
    constraints: Sequence[str],
    parameters: Mapping[str, Any],
    limits: Limits | None = None,
) -> Contradictions:
    """Find the errors of the key `constraints`.

    Each constraint is first checked on its own. If all are valid, they are checked
    together.

    Parameters
    ----------
    constraints : sequence of str
        The constraints as the user wrote them.
    parameters : mapping
        The section `parameters`, whose entries are valid.
    limits : mapping, optional
        See `ParameterSpace.of`.

    Yields
    ------
    pair of str
        Position of the constraint in the list, counted from 0 and written as text, and
        what is allowed. The position is an empty string if the error concerns all
        constraints together.
    """
    errors = []
    for k, text in enumerate(constraints):
        allowed = _describe_allowed_constraint(text, parameters)
        if allowed is not None:
            errors.append((str(k), allowed))
    if errors:
        yield from errors
        return

    # Check that all constraints together leave enough of the ranges.
    space = ParameterSpace.of(parameters, limits=limits, constraints=constraints)
    allowed_fraction = space.allowed_fraction
    if allowed_fraction < MIN_ALLOWED_FRACTION:
        yield (
            "",
            f"constraints that allow at least {100 * MIN_ALLOWED_FRACTION:g} % of the "
            f"ranges, and of their priors; these allow {100 * allowed_fraction:.2g} %: "
            "narrow the ranges to where the constraints are obeyed",
        )


def _describe_allowed_constraint(
    text: str, parameters: Mapping[str, Any]
) -> str | None:
    """Check a single constraint, and describe what is allowed if it is invalid.

    Parameters
    ----------
    text : str
        The constraint as the user wrote it.
    parameters : mapping
        The section `parameters`, whose entries are valid.

    Returns
    -------
    str or None
        What is allowed, for an error message; None if the constraint is valid.
    """
    try:
        constraint = Constraint.parse(text, tuple(parameters))
    except ValueError as error:
        return str(error)
    names = (constraint.smaller.name, constraint.larger.name)
    if all("fixed" in parameters[name] for name in names):
        return "a constraint with a parameter that is not fixed"
    return None


def count_free(parameters: Mapping[str, Any]) -> int:
    """Count the parameters of a section that are not fixed."""
    return sum("fixed" not in entry for entry in parameters.values())
