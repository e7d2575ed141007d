"""Fill the Jinja2 templates of the report, which escape every value."""

import math
import re
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from repose.common.numbers import format_significant

# Several numbers in one cell, such as one for each input of a network
NUMBERS = re.compile(r"{0}( {0})+".format(r"-?[0-9]+(\.[0-9]+)?(e[-+][0-9]+)?"))
PAGE_FOLDER = Path(__file__).parent


def cell_text(value: Any) -> str:
    """Write a table cell: numbers with four digits; None and NaN as an empty string.

    The text of a cell may be a list of decimal numbers, separated by spaces.
    """
    if value is None:
        return ""
    if isinstance(value, float):
        return "" if math.isnan(value) else format_significant(value)
    text = str(value)
    if NUMBERS.fullmatch(text):
        return " ".join(format_significant(float(number)) for number in text.split())
    return text


def plus_minus(text: str) -> str:
    """Replace +-, as messages in a terminal have it, by the sign ±."""
    return text.replace("+-", "±")


def _make_environment() -> Environment:
    """Make the environment of the templates. A missing value is an error."""
    environment = Environment(
        loader=FileSystemLoader(PAGE_FOLDER / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["cell_text"] = cell_text
    environment.filters["plus_minus"] = plus_minus
    environment.policies["json.dumps_kwargs"] = {
        "allow_nan": False,
        "separators": (",", ":"),
    }
    return environment


ENVIRONMENT = _make_environment()


def render_template(name: str, **values: Any) -> str:
    """Fill a template in the folder `templates` with values."""
    return ENVIRONMENT.get_template(name).render(**values)


def read_asset(name: str) -> str:
    """Read a style sheet or a script in this folder."""
    return (PAGE_FOLDER / name).read_text(encoding="utf-8")
