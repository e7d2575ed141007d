"""Write the report as one page: its HTML, numbers as JSON, style and scripts."""

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from repose.bench.parameters import LABELS
from repose.calibrate.constraints import Constraint
from repose.calibrate.targets import Target
from repose.common.files import read_table, write_text
from repose.grain.particle import Particle
from repose.report.page import prediction, scene, sections, three
from repose.report.page.study import Files, Results, read_results
from repose.report.page.tables import format_tables
from repose.report.page.templates import read_asset, render_template
from repose.report.page.verdict import make_verdict
from repose.report.study_view import Config, parameter_ranges

if TYPE_CHECKING:
    import pandas as pd

AXIS_MARGIN = 0.04  # on each side of a gauge, as a fraction of the extent of its data


def write_report(
    config: Config,
    jobs: Sequence[str],
    files: Files,
    tables: Files,
    out_path: str | os.PathLike[str],
) -> None:
    """Write the report of a study from its files.

    Parameters
    ----------
    config : mapping
        The configuration of the study.
    jobs : sequence of paths
        Measured runs of the answer, a file for each bench test.
    files : mapping
        Paths by name, as for `repose.report.page.study.read_results`.
    tables : mapping
        Paths of further tables by their title.
    out_path : path
        File of the page.
    """
    results = read_results(config, jobs, files)
    frames = {title: read_table(path) for title, path in tables.items()}
    write_report_of_results(results, frames, out_path)


def write_report_of_results(
    results: Results,
    tables: Mapping[str, "pd.DataFrame"],
    out_path: str | os.PathLike[str],
) -> None:
    """Write the report of a study whose results are in memory.

    Parameters
    ----------
    results : Results
        The results.
    tables : mapping
        Further tables by title.
    out_path : path
        File of the page.
    """
    text = render_template(
        "report.html",
        **sections.make_template_values(results, tables),
        content=make_script_data(results),
        style_sheet=read_asset("report.css"),
        scripts=_list_scripts(has_view="trajectory" in results.files),
    )
    write_text(out_path, text)


def _list_scripts(has_view: bool) -> list[str]:
    """Return the scripts of the page; those of the 3-D view only if it has one."""
    scripts = [read_asset("network.js")]
    if has_view:
        scripts += [three.read_library(), read_asset("view.js")]
    scripts.append(read_asset("report.js"))
    return scripts


def make_script_data(results: Results) -> dict[str, Any]:
    """Make the data for the scripts of the page, as plain values without NaN."""
    parameters = [
        _describe_parameter(results, name, value)
        for name, value in zip(
            results.parameters.names, results.answer.tolist(), strict=True
        )
    ]
    model = None
    if results.surrogate is not None:
        model = prediction.describe_surrogate(
            results.surrogate, results.parameters, results.answer
        )
    return {
        "parameters": parameters,
        "constraints": [
            _describe_constraint(constraint)
            for constraint in results.parameters.constraints
        ],
        "targets": [_describe_target(results, target) for target in results.targets],
        "copy": format_answer_as_yaml(results),
        "copyMaterial": _format_material_to_copy(results),
        "model": model,
        "pour": _describe_pour(results),
    }


def format_answer_as_yaml(results: Results) -> str:
    """Format the parameters of the answer as YAML for the user to copy.

    The first line is a comment with the name of the study and the verdict.
    """
    lines = [f"# {results.label}: {make_verdict(results).text}"]
    for name, value in zip(
        results.parameters.names, results.answer.tolist(), strict=True
    ):
        line = f"{name}: {value:.6g}"
        if name in LABELS:
            line += f"  # {LABELS[name]}"
        lines.append(line)
    return "\n".join(lines) + "\n"


def _format_material_to_copy(results: Results) -> str | None:
    """Format the values for another program as text; None if there are none."""
    section = sections.make_material_section(results)
    if section is None:
        return None
    return format_tables([section.values, section.laws])


def _describe_parameter(results: Results, name: str, value: float) -> dict[str, Any]:
    """Describe one parameter as plain values for the scripts.

    Parameters
    ----------
    results : Results
        The results of the study.
    name : str
        Name of the parameter.
    value : float
        Value of the parameter in the answer.

    Returns
    -------
    dict
        The values by key. The ends of the range are None for a fixed parameter.
    """
    is_fixed = name in results.parameters.fixed
    low = None
    high = None
    if not is_fixed:
        low, high = parameter_ranges(results.parameters)[name]
    parameter = {
        "name": name,
        "label": LABELS.get(name, ""),  # parameters of other simulators have none
        "value": value,
        "fixed": is_fixed,
        "low": low,
        "high": high,
    }
    if name in results.parameters.scale:
        parameter["scale"] = results.parameters.scale[name]
    return parameter


def _describe_constraint(constraint: Constraint) -> dict[str, Any]:
    """Describe a constraint as plain values: its text and its two terms."""
    return {
        "text": constraint.text,
        "smaller": constraint.smaller._asdict(),
        "larger": constraint.larger._asdict(),
    }


def _describe_target(results: Results, target: Target) -> dict[str, Any]:
    """Describe one target as plain values for the scripts.

    `report.js` reads the values by these keys. `standardError` is the standard error of
    the measured mean, and `error` that of the simulated mean. `optimism` is the error
    of the prediction that is expected because the search favours points where the
    surrogate errs towards the target. `axis` holds the limits of the target's gauge.
    They enclose the samples, the target range, the measured mean with its standard
    deviation, and the simulated mean.
    """
    # Attributes of the response such as `simulated` are names of columns.
    response = target.response
    simulated = results.get_number(response.simulated)
    values = [
        *results.samples[target.name].dropna(),
        target.low,
        target.high,
        target.value - target.sd,
        target.value + target.sd,
    ]
    if simulated is not None:
        values.append(simulated)
    margin = AXIS_MARGIN * (max(values) - min(values))
    return {
        "name": response.name,
        "label": response.label,
        "unit": response.unit,
        "value": target.value,
        "sd": target.sd,
        "standardError": target.standard_error,
        "low": target.low,
        "high": target.high,
        "simulated": simulated,
        "error": results.get_number(response.standard_error),
        "optimism": results.get_number(response.optimism),
        "optimismError": results.get_number(response.optimism_error),
        "axis": [float(min(values) - margin), float(max(values) + margin)],
    }


def _describe_pour(results: Results) -> dict[str, Any] | None:
    """Describe the pour of the 3-D view as plain values; None without a trajectory."""
    if "trajectory" not in results.files or results.settings is None:
        return None
    pour = scene.export_pour(
        results.files["trajectory"],
        Particle.load(results.files["particle"]),
        results.settings.funnel,
    )
    return pour | {"colour": results.settings.colour}
