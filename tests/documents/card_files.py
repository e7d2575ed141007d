"""The schema of the material card and its page, made from its models: `python tests/documents/card_files.py`."""

import json
from pathlib import Path

from repose.stages import card

ROOT = Path(__file__).parents[2]
SCHEMA = ROOT / "src/repose/stages/card.schema.json"
PAGE = ROOT / "docs/card.md"
HEAD = """# The material card

This page answers one question: what does each key of the file `card.json` mean?

A material card is the result of a calibration in one file, `card.json`. It describes the grain and the contact laws,
lists the calibrated parameters, and records the experiments on which they are based. Use this page if you write a program that reads
cards, or to look up a single key. To print a card, use `repose card show results/card.json`.

- The file is a [Card](#card) if repose simulated the study, and an [OtherCard](#othercard) if another program did.
  The other sections describe parts of these two.
- A key in *italics* may be missing.
- Units are SI unless the name of the key contains another unit.
- Your program can check a card with the schema [card.schema.json](../src/repose/stages/card.schema.json).

This page and the schema are made from the models in `repose.stages.card`. If you change a model,
run `python tests/documents/card_files.py`.
"""


def type_of(schema):
    """A type of the schema in words."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return "any" if name == "JsonValue" else f"[{name}](#{name.lower()})"
    if "anyOf" in schema:
        return " or ".join(type_of(option) for option in schema["anyOf"])
    if "const" in schema:
        return f"`{json.dumps(schema['const'])}`"
    if "enum" in schema:
        return ", ".join(f"`{json.dumps(option)}`" for option in schema["enum"])
    kind = schema.get("type", "any")
    if kind == "array":
        return f"list of {type_of(schema['items'])}{bounds_of(schema)}"
    if kind == "object":
        return f"mapping to {type_of(schema.get('additionalProperties', {}))}"
    names = {"number": "number", "integer": "whole number", "string": "text"}
    return f"{names.get(kind, kind)}{bounds_of(schema)}"


def bounds_of(schema):
    """The bounds of a number or of the length of a list."""
    phrases = {
        "minimum": "from",
        "exclusiveMinimum": "above",
        "maximum": "to",
        "minItems": "of at least",
        "maxItems": "of at most",
    }
    if "minItems" in schema and schema["minItems"] == schema.get("maxItems"):
        return f" of {schema['minItems']}"
    return "".join(
        f" {word} {schema[key]:g}" for key, word in phrases.items() if key in schema
    )


def section(name, schema):
    """The keys of a model as a table."""
    lines = [
        f"## {name}",
        "",
        schema.get("description", ""),
        "",
        "| key | type | meaning |",
        "|---|---|---|",
    ]
    for key, field in schema["properties"].items():
        shown = f"`{key}`" if key in schema["required"] else f"*`{key}`*"
        lines.append(f"| {shown} | {type_of(field)} | {field.get('description', '')} |")
    return "\n".join(lines) + "\n"


def texts():
    """The text of each file."""
    schema = card.make_schema()
    models = {
        name: model for name, model in schema["$defs"].items() if "properties" in model
    }
    first = ("Card", "OtherCard")
    order = [*first, *(name for name in models if name not in first)]
    page = "\n".join([HEAD, *(section(name, models[name]) for name in order)])
    return {SCHEMA: json.dumps(schema, indent=1) + "\n", PAGE: page}


if __name__ == "__main__":
    for path, text in texts().items():
        path.write_text(text)
