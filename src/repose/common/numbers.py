"""Write numbers for people."""

# From this size on a number has an exponent; below 0.0001 it has one, too.
LARGEST_PLAIN = 1e5


def rounded(value: float, digits: int = 4, sign: str = "") -> str:
    """Write a number with at most so many significant digits.

    Numbers from 0.0001 to 100,000 have no exponent.

    Parameters
    ----------
    value : float
    digits : int, optional
        From 1 to 4.
    sign : str, optional
        ``+`` to write the sign of a positive number, too.
    """
    text = f"{value:{sign}.{digits}g}"
    # Format g writes 270 with two digits as 2.7e+02.
    if "e" in text and 1 <= abs(value) < LARGEST_PLAIN:
        return f"{float(text):{sign}.0f}"
    return text
