"""Format numbers for readers."""

import math

# Numbers of at least the first size or below the second one are written with an
# exponent.
LARGEST_PLAIN = 1e5
SMALLEST_PLAIN = 1e-4
# Significant digits of a standard error, which is itself uncertain, and of a number.
DIGITS_OF_ERROR = 2
MAX_SIGNIFICANT_DIGITS = 4
# Half of the step to which `format_percent` rounds probabilities.
HALF_PERCENT = 0.005


def format_significant(value: float, digits: int = 4, sign: str = "") -> str:
    """Write a number with a limited number of significant digits.

    Numbers from 0.0001 to 100,000 have no exponent.

    Parameters
    ----------
    value : float
        The number.
    digits : int, optional
        The largest number of significant digits, from 1 to 4.
    sign : str, optional
        ``+`` to write the sign of a positive number as well.
    """
    text = f"{value:{sign}.{digits}g}"
    # Format g writes 270 with two digits as 2.7e+02.
    if "e" in text and 1 <= abs(value) < LARGEST_PLAIN:
        return f"{float(text):{sign}.0f}"
    return text


def format_decimals(value: float, decimals: int = 2, sign: str = "") -> str:
    """Write a number with a fixed number of decimals, as the numbers of a column.

    It has fewer decimals if it would otherwise have more than four significant digits.

    Parameters
    ----------
    value : float
        The number.
    decimals : int, optional
        The largest number of decimals.
    sign : str, optional
        ``+`` to write the sign of a positive number as well.
    """
    if not math.isfinite(value):
        return format_significant(value, sign=sign)
    # Round first: 99.996 becomes 100, which has fewer decimals.
    rounded = float(f"{value:.{MAX_SIGNIFICANT_DIGITS}g}")
    if rounded != 0:
        decimals = min(decimals, _count_decimals(rounded, MAX_SIGNIFICANT_DIGITS))
    # A number without decimals may have more than four digits before the point.
    if decimals == 0:
        return format_significant(rounded, sign=sign)
    return f"{value:{sign}.{decimals}f}"


def format_with_error(mean: float, error: float | None, sign: str = "") -> str:
    """Write a mean with its standard error if that is known, as in ``65.98 +- 0.30``.

    The error has two significant digits. The mean has the same number of decimals. It
    has fewer if it would otherwise have more than four significant digits.

    Parameters
    ----------
    mean : float
        The mean.
    error : float or None
        The standard error, in the unit of the mean.
    sign : str, optional
        ``+`` to write the sign of a positive mean as well.

    Returns
    -------
    str
        The mean, and its error if it is known.
    """
    if error is None:
        return format_significant(mean, sign=sign)

    # A tiny error would need many decimals, and an infinite number has none. Write both
    # numbers separately in these cases.
    has_decimals = SMALLEST_PLAIN <= error < math.inf and math.isfinite(mean)
    if not has_decimals:
        mean_text = format_significant(mean, sign=sign)
        return f"{mean_text} +- {format_significant(error, DIGITS_OF_ERROR)}"

    # Round the error first: 9.96 becomes 10, which has fewer decimals.
    rounded_error = float(f"{error:.{DIGITS_OF_ERROR}g}")
    decimals = _count_decimals(rounded_error, DIGITS_OF_ERROR)
    mean_text = format_decimals(mean, decimals, sign)
    return f"{mean_text} +- {rounded_error:.{decimals}f}"


def format_percent(probability: float | None) -> str:
    """Format a probability in whole percent, but never as 0 % or 100 %.

    The number of runs is too small for such certainty.
    """
    if probability is None:
        return "unknown"
    # Beyond these limits, the rounded probability would be 0 % or 100 %.
    if probability > 1 - HALF_PERCENT:
        return "more than 99 %"
    if probability < HALF_PERCENT:
        return "less than 1 %"
    return f"{100 * probability:.0f} %"


def _count_decimals(value: float, digits: int) -> int:
    """Count the decimals of a number that is written with some significant digits.

    Parameters
    ----------
    value : float
        The number, which must not be 0.
    digits : int
        The number of significant digits. For example, 65.98 has two decimals if it is
        written with four digits.
    """
    power_of_ten = math.floor(math.log10(abs(value)))
    return max(digits - 1 - power_of_ten, 0)
