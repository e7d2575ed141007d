"""Find entries of a material card that contradict each other.

A card that somebody edited by hand may be valid, and still state a verdict that does
not follow from its own means, or a mass that is not that of its volume. Only what the
card itself states is compared. Two entries contradict each other if they differ by
more than the rounding of their digits explains.
"""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from itertools import pairwise, product
from typing import Any, NamedTuple

from repose.calibrate.answer import (
    NOT_SIMULATED_AGAIN,
    Check,
    Verdict,
    judge_probability,
)
from repose.common.errors import InputError, YamlError
from repose.common.numbers import format_significant

# Two physical quantities that differ by at most this fraction count as the same, in
# addition to the rounding of their digits.
RELATIVE_TOLERANCE = 1e-3
# So do two probabilities that differ by at most this. A joint probability is estimated
# from random draws, and probabilities are printed with two digits.
PROBABILITY_TOLERANCE = 0.005
# Largest difference between two correlations, which a card has with four decimals.
CORRELATION_TOLERANCE = 1e-3
ONE_ELLIPSOID = 4 / 3 * math.pi
INERTIA_OF_ELLIPSOID = 1 / 5

Entry = Mapping[str, Any]
Reasons = Mapping[str, Any]


class _Bounds(NamedTuple):
    """The smallest and the largest value that a number may have."""

    low: float
    high: float

    def contains(self, value: float, tolerance: float = 0.0) -> bool:
        """Tell whether a number, or its rounding, lies between the bounds."""
        margin = tolerance + _half_digit(value)
        return self.low - margin <= value <= self.high + margin


class Contradiction(NamedTuple):
    """An entry of a card that does not follow from other entries.

    Attributes
    ----------
    key : str
        The dotted key of the entry.
    value : object
        Its value.
    expected : str
        What follows from the other entries.
    reasons : mapping
        The values of the other entries by their keys.
    """

    key: str
    value: Any
    expected: str
    reasons: Reasons

    def describe(self, source: object) -> InputError:
        """Make an error that names both entries with their values."""
        because = ", ".join(
            f"{key} is {json.dumps(value, ensure_ascii=False)}"
            for key, value in self.reasons.items()
        )
        return YamlError(
            source,
            key=self.key,
            value=self.value,
            allowed=f"{self.expected}, because {because}",
        )


def find_contradictions(card: Entry) -> Iterator[Contradiction]:
    """Find the entries of a card that contradict each other.

    Parameters
    ----------
    card : mapping
        A card that passed `repose.stages.card.check_card`.

    Yields
    ------
    Contradiction
        One for each entry that does not follow from others.
    """
    for number, test in enumerate(card["tests"]):
        yield from _check_test(f"tests.{number}", test)
    if "verdict" in card:
        yield from _check_verdict(card)
    else:
        yield from _check_met_of_older_card(card)
    yield from _check_probabilities(card)
    # Cards without this key are of a version that did not widen intervals.
    if "reason" in card:
        yield from _check_intervals(card["parameters"])
    yield from _check_correlations(card)
    yield from _check_samples_inside(card)
    if "grain" in card:
        yield from _check_grain(card["grain"])


# --- tests and verdicts ---------------------------------------------------------------


def _check_test(prefix: str, test: Entry) -> Iterator[Contradiction]:
    """Compare the entries of a test with each other; `prefix` is the key of the test."""
    if test["low"] > test["high"]:
        yield _contradict(prefix, test, "low", "at most the upper end", "high")
    if test["standard_error"] is not None and test["runs"] < 2:
        expected = "null for fewer than two runs"
        yield _contradict(prefix, test, "standard_error", expected, "runs")
    if test["simulated"] is not None and test["runs"] < 1:
        yield _contradict(prefix, test, "simulated", "null without runs", "runs")
    yield from _check_definitions(prefix, test)
    if "verdict" in test:
        yield from _check_met(f"{prefix}.", test)
        yield from _check_verdict_of_test(prefix, test)
    elif test["simulated"] is not None:
        # An older card says whether the mean of the runs lies inside the range.
        allowed = _judge_by_mean(Check.from_card_entry(test))
        if test["met"] not in allowed:
            reasons = ("simulated", "low", "high")
            yield _contradict(prefix, test, "met", _join(allowed), *reasons)


def _check_verdict_of_test(prefix: str, test: Entry) -> Iterator[Contradiction]:
    """Compare a test's probability with its means, and its verdict with both."""
    check = Check.from_card_entry(test)
    has_no_mean = test["simulated"] is None or test["status"] == NOT_SIMULATED_AGAIN
    if "probability_inside" in test:
        expected = _bound_probability(check)
        stated = test["probability_inside"]
        key = "probability_inside"
        numbers = ("simulated", "standard_error", "runs", "low", "high")
        if expected is None:
            if stated is not None:
                yield _contradict(prefix, test, key, "null", *numbers)
        elif stated is None or not expected.contains(stated, PROBABILITY_TOLERANCE):
            yield _contradict(prefix, test, key, _about(expected), *numbers)
        if not has_no_mean:
            # The verdict follows from the probability alone.
            verdicts = _list_verdicts(stated)
            if Verdict(test["verdict"]) not in verdicts:
                yield _contradict(prefix, test, "verdict", _join(verdicts), key)
    if has_no_mean and Verdict(test["verdict"]) is not check.verdict:
        expected_verdict = _join([check.verdict])
        outcome = ("simulated", "status")
        yield _contradict(prefix, test, "verdict", expected_verdict, *outcome)


def _contradict(
    prefix: str, entry: Entry, key: str, expected: str, *reasons: str
) -> Contradiction:
    """Make a contradiction between keys of one entry, whose own key is `prefix`."""
    return Contradiction(
        f"{prefix}.{key}",
        entry[key],
        expected,
        {f"{prefix}.{reason}": entry[reason] for reason in reasons},
    )


def _check_definitions(prefix: str, test: Entry) -> Iterator[Contradiction]:
    """Compare the mean of a test with that of the same line among all definitions."""
    for name, angle in test.get("definitions", {}).items():
        if angle["line"] != test.get("line"):
            continue
        for key in ("simulated", "standard_error"):
            of_line = angle[key]
            stated = test[key]
            if of_line is None or stated is None:
                continue
            if not _is_same(stated, of_line):
                yield Contradiction(
                    f"{prefix}.{key}",
                    stated,
                    "the number of the same line",
                    {f"{prefix}.definitions.{name}.{key}": of_line},
                )


def _check_met(prefix: str, entry: Entry) -> Iterator[Contradiction]:
    """Compare `met` of a card or of a test with its verdict."""
    met = Verdict(entry["verdict"]).met
    if entry["met"] is not met:
        yield Contradiction(
            f"{prefix}met",
            entry["met"],
            _write_met(met),
            {f"{prefix}verdict": entry["verdict"]},
        )


def _check_verdict(card: Entry) -> Iterator[Contradiction]:
    """Compare the verdict of a card with those of its tests and its probability."""
    yield from _check_met("", card)
    verdict = Verdict(card["verdict"])
    verdicts = {
        f"tests.{number}.verdict": Verdict(test["verdict"])
        for number, test in enumerate(card["tests"])
        if "verdict" in test
    }

    # A test that is not checked, or not met, decides.
    for decisive in (Verdict.UNCHECKED, Verdict.NOT_MET):
        keys = [key for key, value in verdicts.items() if value is decisive]
        if keys:
            if verdict is not decisive:
                yield Contradiction(
                    "verdict",
                    card["verdict"],
                    repr(decisive.value),
                    {keys[0]: decisive.value},
                )
            return
    if verdict is Verdict.UNCHECKED and verdicts:
        yield Contradiction(
            "verdict",
            card["verdict"],
            "another one",
            {key: value.value for key, value in verdicts.items()},
        )
    if verdict is Verdict.UNCHECKED:
        return
    if verdict is Verdict.NOT_MET:
        # The prediction may miss the targets, which a card states only in words.
        return
    if card.get("out_of_reach"):
        yield Contradiction(
            "verdict",
            card["verdict"],
            repr(Verdict.NOT_MET.value),
            {"out_of_reach": True},
        )
    elif "probability_inside" in card:
        allowed = _list_verdicts(card["probability_inside"])
        if verdict not in allowed:
            yield Contradiction(
                "verdict",
                card["verdict"],
                _join(allowed),
                {"probability_inside": card["probability_inside"]},
            )


def _check_met_of_older_card(card: Entry) -> Iterator[Contradiction]:
    """Compare `met` of a card without a verdict with those of its tests."""
    for number, test in enumerate(card["tests"]):
        # The answer may be not met because its prediction misses the targets.
        if card["met"] is True and test["met"] is not True:
            yield Contradiction(
                "met", True, "false or null", {f"tests.{number}.met": test["met"]}
            )
    if card["met"] is True and card.get("out_of_reach"):
        yield Contradiction("met", True, "false", {"out_of_reach": True})


def _check_probabilities(card: Entry) -> Iterator[Contradiction]:
    """Compare the joint probabilities of a card with those of its tests."""
    # A mean lies within 2 % of its target if it lies within 1 %.
    by_tolerance = sorted(
        (float(key.removesuffix("%")), key)
        for key in card["within"]
        if _is_number(key.removesuffix("%"))
    )
    for (_, narrow), (_, wide) in pairwise(by_tolerance):
        low = card["within"][narrow]
        high = card["within"][wide]
        if low is not None and high is not None and low > high + _half_digit(high):
            yield Contradiction(
                f"within.{narrow}",
                low,
                "at most that of the wider tolerance",
                {f"within.{wide}": high},
            )

    joint = card.get("probability_inside")
    stated = {
        f"tests.{number}.probability_inside": test.get("probability_inside")
        for number, test in enumerate(card["tests"])
    }
    numbers = {key: value for key, value in stated.items() if value is not None}
    if "probability_inside" not in card or len(numbers) < len(stated):
        return
    # Whatever the correlation of the responses, the probability that all means lie
    # inside is at most the smallest one, and all but the sum of the misses.
    bounds = _Bounds(
        max(0.0, 1 - sum(1 - value for value in numbers.values())),
        min(numbers.values()),
    )
    if joint is None or not bounds.contains(joint, PROBABILITY_TOLERANCE):
        yield Contradiction("probability_inside", joint, _about(bounds), numbers)


def _bound_probability(check: Check) -> _Bounds | None:
    """Bound the probability of a check, given that its numbers may be rounded."""
    if check.probability is None:
        return None
    assert check.simulated is not None
    assert check.standard_error is not None

    def compute(simulated: float, error: float, low: float, high: float) -> float:
        changed = replace(
            check,
            simulated=simulated,
            standard_error=max(error, 0.0),
            low=low,
            high=high,
        )
        probability = changed.probability
        assert probability is not None
        return probability

    numbers = (check.simulated, check.standard_error, check.low, check.high)
    return _bound(compute, numbers)


def _judge_by_mean(check: Check) -> set[bool]:
    """Tell whether a mean lies inside its range; both if its rounding decides."""
    assert check.simulated is not None
    margin = max(map(_half_digit, (check.simulated, check.low, check.high)))
    return {check.margin >= -margin, check.margin >= margin}


def _list_verdicts(probability: float | None) -> set[Verdict]:
    """List the verdicts of a probability that may be rounded."""
    if probability is None:
        return {judge_probability(None)}
    half_digit = _half_digit(probability)
    return {
        judge_probability(probability + step) for step in (-half_digit, 0, half_digit)
    }


# --- parameters -----------------------------------------------------------------------


def _check_intervals(parameters: Mapping[str, Entry]) -> Iterator[Contradiction]:
    """Compare the value of each parameter with its interval and its remarks."""
    for name, parameter in parameters.items():
        key = f"parameters.{name}"
        low = parameter["low"]
        high = parameter["high"]
        value = parameter["value"]
        is_fixed = parameter["given"] == "fixed"
        if (low is None) is not is_fixed or (high is None) is not is_fixed:
            yield Contradiction(
                f"{key}.given",
                parameter["given"],
                "fixed without an interval, and calibrated with one",
                {f"{key}.low": low, f"{key}.high": high},
            )
            continue
        if is_fixed:
            continue
        ends = {f"{key}.low": low, f"{key}.high": high}
        if low > high:
            yield Contradiction(
                f"{key}.low", low, "at most the upper end", {f"{key}.high": high}
            )
        # An interval holds its value. In cards of older versions, it may exclude a value
        # at a bound of the range; then it is not widened.
        elif ("at_bound" not in parameter or "widened" in parameter) and not _Bounds(
            low - _half_digit(low), high + _half_digit(high)
        ).contains(value):
            yield Contradiction(
                f"{key}.value", value, "a number from low to high", ends
            )
        # A widened interval ends at the value, or at the bound at which this lies.
        elif (
            "widened" in parameter
            and "at_bound" not in parameter
            and not (_is_same(value, low) or _is_same(value, high))
        ):
            yield Contradiction(
                f"{key}.widened",
                True,
                "low or high to be the value itself",
                {f"{key}.value": value, **ends},
            )


def _check_samples_inside(card: Entry) -> Iterator[Contradiction]:
    """Compare the number of samples that meet all targets with that of all samples."""
    if "samples_inside" not in card:
        return
    counts = card["samples_inside"]
    if counts["inside"] > counts["samples"]:
        expected = "at most the number of all samples"
        yield _contradict("samples_inside", counts, "inside", expected, "samples")


def _check_correlations(card: Entry) -> Iterator[Contradiction]:
    """Compare each correlation with that of the same pair in the other order."""
    correlations = card["correlations"]
    for first, of_first in correlations.items():
        for second, value in of_first.items():
            other = correlations.get(second, {}).get(first)
            # Yield each pair once.
            if other is None or first >= second:
                continue
            if abs(value - other) > CORRELATION_TOLERANCE:
                yield Contradiction(
                    f"correlations.{first}.{second}",
                    value,
                    "the same in both orders",
                    {f"correlations.{second}.{first}": other},
                )


# --- the grain ------------------------------------------------------------------------


def _check_grain(grain: Entry) -> Iterator[Contradiction]:
    """Compare moduli, volume, mass and moments of inertia of the grain."""
    yield from _compare(
        grain,
        "elastic_modulus_pa",
        lambda modulus, ratio: 2 * modulus * (1 + ratio),
        "shear_modulus_pa",
        "poisson_ratio",
    )
    # A clump of spheres has the mass of the grain that it stands for.
    if grain["shape"] != "multisphere":
        yield from _compare(
            grain,
            "mass_g",
            lambda density, volume: 1e-6 * density * volume,
            "density_kg_m3",
            "volume_mm3",
        )
    yield from _check_body(grain)


def _check_body(grain: Entry) -> Iterator[Contradiction]:
    """Compare shape, volume and moments of inertia with the ellipsoids and spheres."""
    ellipsoids = grain["ellipsoids_mm"]
    spheres = grain["spheres_mm"]
    is_clump = grain["shape"] == "multisphere"
    if (is_clump and ellipsoids and not spheres) or (not is_clump and spheres):
        yield Contradiction(
            "grain.shape",
            grain["shape"],
            "multisphere for spheres, and another shape for ellipsoids",
            {
                "grain.ellipsoids_mm": ellipsoids,
                "grain.spheres_mm": spheres,
            },
        )
        return
    # The sum of several ellipsoids has no volume in closed form.
    if len(ellipsoids) != 1 or is_clump:
        return
    reasons = {"grain.ellipsoids_mm.0": ellipsoids[0]}
    volume = _bound(lambda *axes: ONE_ELLIPSOID * math.prod(axes), ellipsoids[0])
    if not _is_within(grain["volume_mm3"], volume):
        yield Contradiction(
            "grain.volume_mm3", grain["volume_mm3"], _about(volume), reasons
        )
    if "inertia_kg_m2" not in grain:
        return
    expected = sorted(
        _bound(
            lambda mass, *axes: (
                1e-9 * INERTIA_OF_ELLIPSOID * mass * math.hypot(*axes) ** 2
            ),
            (grain["mass_g"], *pair),
        )
        for pair in _list_pairs(ellipsoids[0])
    )
    stated = sorted(grain["inertia_kg_m2"])
    for value, bounds in zip(stated, expected, strict=True):
        if not _is_within(value, bounds):
            number = grain["inertia_kg_m2"].index(value)
            yield Contradiction(
                f"grain.inertia_kg_m2.{number}",
                value,
                _about(bounds),
                {"grain.mass_g": grain["mass_g"], **reasons},
            )


def _compare(
    grain: Entry, key: str, function: Callable[..., float], *names: str
) -> Iterator[Contradiction]:
    """Compare a quantity of the grain with a function of others."""
    bounds = _bound(function, [grain[name] for name in names])
    if not _is_within(grain[key], bounds):
        reasons = {f"grain.{name}": grain[name] for name in names}
        yield Contradiction(f"grain.{key}", grain[key], _about(bounds), reasons)


def _list_pairs(axes: Sequence[float]) -> list[tuple[float, float]]:
    """List the pairs of half axes that are across each axis."""
    a, b, c = axes
    return [(b, c), (a, c), (a, b)]


# --- numbers --------------------------------------------------------------------------


def _half_digit(value: float) -> float:
    """Return half a unit of the last digit that a number has in the file."""
    exponent = Decimal(repr(value)).as_tuple().exponent
    return 0.5 * 10.0 ** int(exponent)


def _bound(function: Callable[..., float], numbers: Sequence[float]) -> _Bounds:
    """Bound a function of numbers, each of which may be rounded in its last digit."""
    choices = [
        (value - _half_digit(value), value, value + _half_digit(value))
        for value in numbers
    ]
    results = [function(*chosen) for chosen in product(*choices)]
    return _Bounds(min(results), max(results))


def _is_within(value: float, bounds: _Bounds) -> bool:
    """Tell whether a physical quantity lies between bounds, within the tolerance."""
    return bounds.contains(value, RELATIVE_TOLERANCE * abs(value))


def _is_same(first: float, second: float) -> bool:
    """Tell whether two numbers are the same, or roundings of each other."""
    half_digit = max(_half_digit(first), _half_digit(second))
    return math.isclose(first, second, rel_tol=1e-9, abs_tol=half_digit)


def _is_number(text: str) -> bool:
    """Tell whether a text is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _about(bounds: _Bounds) -> str:
    """Describe the numbers between bounds."""
    low = format_significant(bounds.low)
    high = format_significant(bounds.high)
    return f"about {low}" if low == high else f"from {low} to {high}"


def _join(values: Iterable[Any]) -> str:
    """List allowed verdicts, or values of `met`."""
    texts = [
        repr(value.value) if isinstance(value, Verdict) else _write_met(value)
        for value in values
    ]
    return " or ".join(sorted(texts))


def _write_met(met: bool | None) -> str:
    """Write a value of `met` as in JSON."""
    return {True: "true", False: "false", None: "null"}[met]
