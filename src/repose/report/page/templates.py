"""Fill the Jinja2 templates of the report, which escape every value."""

import math
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from repose.common.numbers import format_significant

PAGE_FOLDER = Path(__file__).parent


def cell_text(value: Any) -> str:
    """Write a table cell: a float with four digits; None and NaN as an empty string."""
    if value is None:
        return ""
    if isinstance(value, float):
        return "" if math.isnan(value) else format_significant(value)
    return str(value)


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
