"""The report as one page: HTML of the sections, numbers as JSON, style and scripts of this folder."""

import html
import json
import os
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from repose.bench.parameters import LABELS
from repose.calibrate.targets import Target
from repose.common.files import read_table, write_text
from repose.grain.particle import Particle
from repose.report.page import prediction, scene, sections, three
from repose.report.page.html import fill, own
from repose.report.page.study import Files, Results, read
from repose.report.shown import Config

if TYPE_CHECKING:
    import pandas as pd


def write(
    config: Config,
    jobs: Sequence[str],
    files: Files,
    tables: Files,
    out_path: str | os.PathLike[str],
) -> None:
    """Write the report of a study from its files."""
    write_study(
        read(config, jobs, files),
        {title: read_table(path) for title, path in tables.items()},
        out_path,
    )


def write_study(
    study: Results,
    tables: Mapping[str, "pd.DataFrame"],
    out_path: str | os.PathLike[str],
) -> None:
    """Write the report of a study in memory; `tables` are further tables by title."""
    parts = (
        sections.answer,
        sections.check,
        sections.other_parameters,
        sections.how_found,
    )
    body = "\n".join([*(part(study) for part in parts), sections.all_tables(tables)])
    write_text(
        out_path,
        assembled(f"Contact parameters: {study.shown.label}", body, content(study)),
    )


def content(study: Results) -> dict[str, Any]:
    """Give data for the scripts: plain values without NaN."""
    page: dict[str, Any] = {
        "parameters": [_parameter(study, k) for k in range(len(study.space.names))],
        "targets": [_target(study, target) for target in study.targets],
        "copy": for_copy(study),
        "model": prediction.for_page(study.surrogate, study.space, study.answer)
        if study.surrogate
        else None,
        "pour": None,
    }
    if "trajectory" in study.files:
        pour = scene.for_page(
            study.files["trajectory"],
            Particle.load(study.files["particle"]),
            study.shown.funnel,
        )
        page["pour"] = pour | {"colour": study.shown.colour}
    return page


def for_copy(study: Results) -> str:
    """Write the parameters as lines of YAML."""
    values = zip(study.space.names, study.answer.tolist(), strict=True)
    lines = (
        f"{name}: {value:.6g}  # {LABELS.get(name, name)}\n" for name, value in values
    )
    return f"# {study.shown.label}: {sections.verdict(study)[1]}\n{''.join(lines)}"


def assembled(title: str, body: str, values: Mapping[str, Any]) -> str:
    """Write the whole page as text; `body` is HTML, `values` go to the scripts as JSON."""
    # JSON allows "<" in this form; it cannot end the script early
    coded = json.dumps(values, allow_nan=False, separators=(",", ":")).replace(
        "<", "\\u003c"
    )
    view = own("view.js")
    drawing = (
        (three.library(re.findall(r"THREE\.(\w+)", view)), view)
        if values["pour"]
        else ()
    )
    scripts = "\n".join(
        f"<script>{script}</script>"
        for script in (own("network.js"), *drawing, own("report.js"))
    )
    parts = {
        "style": own("report.css"),
        "body": body,
        "content": coded,
        "scripts": scripts,
    }
    return fill("page.html", title=html.escape(title), **parts) + "\n"


def _parameter(study: Results, k: int) -> dict[str, Any]:
    """Give one parameter as plain values."""
    space, name = study.space, study.space.names[k]
    fixed, label = name in space.fixed, LABELS.get(name, name)
    low, high = (None, None) if fixed else study.shown.ranges[name]
    return {
        "name": name,
        "label": label,
        "value": float(study.answer[k]),
        "fixed": fixed,
        "low": low,
        "high": high,
    }


def _target(study: Results, target: Target) -> dict[str, Any]:
    """Give one target as plain values, with the ends of its gauge."""
    response, simulated = target.response, study.number(target.response.simulated)
    shown = [*study.dataset[target.name].dropna(), target.low, target.high]
    shown += [
        target.value - target.sd,
        target.value + target.sd,
        *([] if simulated is None else [simulated]),
    ]
    margin = 0.04 * (max(shown) - min(shown))
    words = {name: getattr(response, name) for name in ("name", "label", "unit")}
    numbers = {name: getattr(target, name) for name in ("value", "sd", "low", "high")}
    found = {"simulated": simulated, "error": study.number(response.error)}
    return (
        words
        | numbers
        | found
        | {"axis": [float(min(shown) - margin), float(max(shown) + margin)]}
    )
