"""Write numbers for people."""

import math

# Numbers from this size on, and numbers below the smallest, are written with an exponent.
LARGEST_PLAIN = 1e5
SMALLEST_PLAIN = 1e-4


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
        ``+`` to write the sign of a positive number, too.
    """
    text = f"{value:{sign}.{digits}g}"
    # Format g writes 270 with two digits as 2.7e+02.
    if "e" in text and 1 <= abs(value) < LARGEST_PLAIN:
        return f"{float(text):{sign}.0f}"
    return text


def format_with_error(mean: float, error: float | None) -> str:
    """Write a mean with its standard error, if it is known, as in ``65.98 +- 0.30``.

    The error has two significant digits. The mean has as many decimals as the error,
    but at most four significant digits.

    Parameters
    ----------
    mean : float
        The mean.
    error : float or None
        The standard error, in the unit of the mean.
    """
    if error is None:
        return format_significant(mean)
    has_decimals = SMALLEST_PLAIN <= error < math.inf and math.isfinite(mean)
    if not has_decimals:
        return f"{format_significant(mean)} +- {format_significant(error, 2)}"
    # An error of 9.96 is written as 10, so its power of ten is that of the rounded number.
    rounded_error = float(f"{error:.2g}")
    decimals = max(1 - _power_of_ten(rounded_error), 0)
    decimals_of_mean = decimals
    if mean:
        most_decimals = max(3 - _power_of_ten(mean), 0)
        decimals_of_mean = min(decimals, most_decimals)
    return f"{mean:.{decimals_of_mean}f} +- {rounded_error:.{decimals}f}"


def _power_of_ten(value: float) -> int:
    """Return the power of ten of the first digit of a number other than 0."""
    return math.floor(math.log10(abs(value)))
