"""Write the tables of keys in config/README.md from the fields of the sections.

``python -m repose.config.page`` writes the tables into the page. Each table is between
the lines ``<!-- keys: NAME -->`` and ``<!-- end -->``. The text around the tables is
written by hand. The program prints a message for each section without such lines.
"""

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from repose.calibrate.profile_targets import BenchProfile
from repose.common import faults, places
from repose.common.reading import read_yaml
from repose.common.section import ABSENT, Section
from repose.config.models import TargetSettings, make_settings_type
from repose.stages.settings import ParticlesSettings, SimulatorSettings

PAGE_PATH = Path("config", "README.md")
# A table with the lines around it. `format_table` writes lines of the same form.
TABLE_PATTERN = re.compile(r"<!-- keys: (\w+) -->\n.*?<!-- end -->", re.DOTALL)
COLUMNS = ("key", "meaning", "unit", "values", "default", "source")
# The unit of a key follows from the end of its name. A longer end comes before a
# shorter one that it contains, because the first match is used.
UNITS = {
    "_mm_per_pixel": "mm",
    "_mb": "MB",
    "_kg_m3": "kg/m3",
    "_m_s2": "m/s2",
    "_rad_s": "rad/s",
    "_deg_s": "deg/s",
    "_mm_s": "mm/s",
    "_m_s": "m/s",
    "_per_s": "1/s",
    "_percent": "%",
    "_deg": "deg",
    "_mm": "mm",
    "_pa": "Pa",
    "_g": "g",
    "_j": "J",
    "_s": "s",
}


class Table(NamedTuple):
    """A table of the page.

    Attributes
    ----------
    model : type of Section
        The section, with a field for each row of the table.
    defaults : mapping
        The values of the section in config/method.yaml; empty for a section that this
        file does not have.
    """

    model: type[Section]
    defaults: Mapping[str, Any]


def update_tables(text: str) -> str:
    """Replace the tables in the text of the page by up-to-date ones.

    Parameters
    ----------
    text : str
        The page in Markdown. Each table stands between two lines that name it.

    Returns
    -------
    str
        The new page. All other text is unchanged.
    """
    tables_by_name = make_tables()

    def format_table(match: re.Match[str]) -> str:
        """Write the table that a match names, with the lines before and after it."""
        name = match[1]
        # In Markdown a rule separates the header of a table from its rows.
        rule = "|---" * len(COLUMNS) + "|"
        lines = [_format_line(COLUMNS), rule, *_format_rows(tables_by_name[name])]
        table_text = "\n".join(lines)
        return f"<!-- keys: {name} -->\n\n{table_text}\n\n<!-- end -->"

    return TABLE_PATTERN.sub(format_table, text)


def list_sections_without_table(text: str) -> list[str]:
    """List the sections of the configuration for which the page has no table."""
    named = TABLE_PATTERN.findall(text)
    return [name for name in make_tables() if name not in named]


def make_tables() -> dict[str, Table]:
    """Make all tables of the page config/README.md.

    Returns
    -------
    dict of str to Table
        The tables by their names in the page. The name of a section's table is the name
        of the section. The table `study` has the keys outside sections.
    """
    method_config = read_yaml(places.find_program_folder() / places.METHOD_CONFIG)
    settings_type = make_settings_type()
    # config/method.yaml has no values for the last four tables.
    tables_by_name = {
        "study": Table(settings_type, defaults=method_config),
        "targets": Table(TargetSettings, defaults={}),
        "profile": Table(BenchProfile, defaults={}),
        "simulator": Table(SimulatorSettings, defaults={}),
        "particles": Table(ParticlesSettings, defaults={}),
    }
    for name, field in settings_type.model_fields.items():
        model = _find_section_model(field)
        if model is not None:
            tables_by_name[name] = Table(model, defaults=method_config.get(name, {}))
    return tables_by_name


def _find_section_model(field: FieldInfo) -> type[Section] | None:
    """Find the model of a key that is a section; None for any other key."""
    kind = field.annotation
    if isinstance(kind, type) and issubclass(kind, Section):
        return kind
    return None


def _format_rows(table: Table) -> Iterator[str]:
    """Yield a row of the table for each key that a user may set."""
    for name, field in table.model.model_fields.items():
        # An inner section has its own table. A key that users may not set has no
        # description.
        if field.description is None or _find_section_model(field) is not None:
            continue
        # The source is the place in the article from which the value comes. Other
        # values are our own choice.
        source: object = "ours"
        extra = field.json_schema_extra
        if isinstance(extra, dict):
            source = extra.get("source", source)
        cells = {
            "key": f"`{name}`",
            "meaning": field.description,
            "unit": _find_unit(name),
            "values": _shorten_allowed(
                faults.describe_allowed_values(name, table.model)
            ),
            "default": _find_default(name, field, table),
            "source": str(source),
        }
        yield _format_line(cells[column] for column in COLUMNS)


def _format_line(cells: Iterable[str]) -> str:
    """Write a line of a table in Markdown."""
    return f"| {' | '.join(cells)} |"


def _find_default(name: str, field: FieldInfo, table: Table) -> str:
    """Find the default of a key, in the file of the method or in its field.

    Parameters
    ----------
    name : str
        The key.
    field : FieldInfo
        The field of the key in the model of the section.
    table : Table
        The table of the section.

    Returns
    -------
    str
        The default as it would appear in a file; empty for a key without a default.
    """
    if name in table.defaults:
        return _format_yaml_value(table.defaults[name])
    if field.default in (PydanticUndefined, ABSENT):
        return ""
    return _format_yaml_value(field.default)


def _shorten_allowed(allowed: str) -> str:
    """Shorten the description of allowed values for a cell of a table."""
    # A list of many numbers contains the multiples of the first one.
    numbers = re.fullmatch(r"(\d+)(?: or \d+){9,} or (\d+)", allowed)
    if numbers:
        return f"{numbers[1]}, 2 x {numbers[1]} and so on to {numbers[2]}"

    # This description lists the forms of a contact parameter.
    pair = allowed.replace("a pair [low, high] of numbers", "[low, high]")
    return pair.replace(
        "with low < high; or fixed; or range with scale; or prior with",
        "; fixed; range with scale; or prior:",
    )


def _find_unit(key: str) -> str:
    """Find the unit at the end of a key's name; `-` for a key without unit."""
    for end, unit in UNITS.items():
        if f"_{key}".endswith(end):
            return unit
    return "-"


def _format_yaml_value(value: Any) -> str:
    """Write a default as it would appear in a file, as code in Markdown."""
    if isinstance(value, str):
        return f"`{value}`"
    return f"`{json.dumps(value)}`"


def main() -> None:
    """Write the tables into the page of the checkout."""
    path = Path(places.find_program_folder()) / PAGE_PATH
    text = update_tables(path.read_text(encoding="utf-8"))
    path.write_text(text, encoding="utf-8")
    for name in list_sections_without_table(text):
        print(
            f"{PAGE_PATH}: no table of the section {name}; expected the lines "
            f"<!-- keys: {name} --> and <!-- end -->"
        )


if __name__ == "__main__":
    main()
