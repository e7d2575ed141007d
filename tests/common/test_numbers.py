"""Numbers as people read them."""

import math

import pytest

from repose.common.numbers import format_decimals, format_with_error


@pytest.mark.parametrize(
    ("mean", "error", "text"),
    [
        (65.983, 0.297, "65.98 +- 0.30"),
        (0.06461, 0.054, "0.065 +- 0.054"),
        (5.0, 9.96, "5 +- 10"),
        (12253.0, 154.0, "12250 +- 150"),
        # The mean keeps four significant digits.
        (32.4712, 0.0123, "32.47 +- 0.012"),
        (0.0, 0.3, "0.00 +- 0.30"),
        (-0.23, 0.08, "-0.230 +- 0.080"),
        # Without decimals that the error could give.
        (0.2, 0.0, "0.2 +- 0"),
        (1e-5, 2e-6, "1e-05 +- 2e-06"),
        (math.nan, 0.3, "nan +- 0.3"),
    ],
)
def test_a_mean_has_the_decimals_of_its_error(mean, error, text):
    assert format_with_error(mean, error) == text


def test_the_sign_of_a_positive_mean_is_written_on_request():
    assert format_with_error(0.06461, 0.054, sign="+") == "+0.065 +- 0.054"
    assert format_with_error(-0.23, 0.08, sign="+") == "-0.230 +- 0.080"
    assert format_with_error(0.4, None, sign="+") == "+0.4"
    assert format_with_error(1e-5, 2e-6, sign="+") == "+1e-05 +- 2e-06"


@pytest.mark.parametrize(
    ("value", "decimals", "text"),
    [
        (26.6449, 2, "26.64"),
        (90.0, 2, "90.00"),
        (110.0, 2, "110.0"),
        (99.996, 2, "100.0"),
        (9.996, 2, "10.00"),
        (0.02496, 2, "0.02"),
        (0.0, 2, "0.00"),
        (-123.456, 2, "-123.5"),
        (12253.0, 1, "12250"),
        (math.nan, 2, "nan"),
    ],
)
def test_a_number_of_a_column_has_at_most_four_digits(value, decimals, text):
    assert format_decimals(value, decimals) == text
