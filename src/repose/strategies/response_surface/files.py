"""The response surface strategy on files: each step reads the files of the previous step."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.core.errors import InputError
from repose.core.files import read_json, read_table, write_json, write_table
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS, named
from repose.core.targets import Targets
from repose.strategies import answer
from repose.strategies.response_surface import screening, surface
from repose.strategies.response_surface.steps import CODED

Path_ = str | os.PathLike


def run_design(space: ParameterSpace, section: Mapping[str, Any], out_csv: Path_) -> pd.DataFrame:
    """Write the samples of the screening; return them.

    `section` is `response_surface` of the configuration, here and below.
    """
    table = screening.design(space, section)
    write_table(out_csv, table)
    return table


def run_screening(
    samples_csv: Path_,
    dataset_csv: Path_,
    space: ParameterSpace,
    targets: Targets,
    section: Mapping[str, Any],
    out_dir: Path_,
    ascent_csv: Path_,
) -> dict[str, Any]:
    """Write the screening's tables and the samples of the ascent; return the parameters of the next steps.

    The result is that of screening.json, with the mean responses at the `centre` and at the `corners`.
    """
    table, dataset = _step(samples_csv, dataset_csv, targets)
    result = screening.screened(table, dataset, space, targets, section, dataset_csv)
    _write(screening.analysis(result.models, targets), out_dir)
    summary = {
        "kept": result.kept,
        "dropped": [name for name in space.free if name not in result.kept],
        "centre": result.centre.to_dict(),
        "corners": dict(zip(targets.names, (float(model.constant) for model in result.models), strict=True)),
    }
    write_json(Path(out_dir) / "screening.json", summary)
    write_table(ascent_csv, result.path)
    return summary


def run_ascent(
    samples_csv: Path_,
    dataset_csv: Path_,
    space: ParameterSpace,
    targets: Targets,
    section: Mapping[str, Any],
    out_dir: Path_,
    surface_csv: Path_,
) -> pd.DataFrame:
    """Write the walked path, path.csv, and the samples of the surface; return the path.

    InputError without a usable sample.
    """
    table, dataset = _step(samples_csv, dataset_csv, targets)
    points = surface.walked(table, dataset, targets)
    write_table(Path(out_dir) / "path.csv", points)
    write_table(surface_csv, surface.design(points, space, section))
    return points


def run_surface(
    samples_csv: Path_,
    dataset_csv: Path_,
    space: ParameterSpace,
    targets: Targets,
    section: Mapping[str, Any],
    out_dir: Path_,
    check_csv: Path_,
) -> dict[str, Any]:
    """Write the surface's tables, its optimum and the samples of the check; return the optimum.

    `met` in optimum.json is whether the surfaces meet the targets.
    """
    table, dataset = _step(samples_csv, dataset_csv, targets)
    models = screening.models_of(table, dataset, targets, "quadratic", dataset_csv)
    best = surface.best_point(models, targets)
    check = surface.check_samples(table, best, space, section)
    out = Path(out_dir)
    _write(screening.analysis(models, targets), out)
    write_table(out / "predictions.csv", surface.predictions(models, best, targets, section["checks"]))
    optimum = {
        "parameters": check.loc[0, list(named(check))].astype(float).to_dict(),
        "coded": dict(zip(models[0].factors, best.coded.tolist(), strict=True)),
        "met": best.met,
        "desirability": best.desirability,
    }
    write_json(out / "optimum.json", optimum)
    write_table(check_csv, check)
    return optimum


def run_check(
    predictions_csv: Path_,
    optimum_json: Path_,
    surface_dir: Path_,
    dataset_csv: Path_,
    runs_csvs: Sequence[Path_],
    config: Mapping[str, Any],
    out_dir: Path_,
) -> pd.DataFrame:
    """Write check.csv and the files of `repose.strategies.answer.write`; return the table of check.csv.

    `runs_csvs` are the single runs of all steps, whose pours are counted; those of the check come last.
    """
    targets, space = Targets.of(config["targets"]), ParameterSpace.of(config["parameters"])
    columns = ("response", "target", "predicted", "low", "high")
    predicted = read_table(predictions_csv, columns)
    keys = ("parameters", "coded", "met")
    best = read_json(optimum_json, keys, "output of repose stage response_surface")
    dataset = read_table(dataset_csv, ("sample", "status", *targets.names))
    check = surface.checked(predicted, dataset)
    write_table(Path(out_dir) / "check.csv", check)
    runs = [read_table(path, ("sample", "status")) for path in runs_csvs]
    details = {"surfaces_meet_targets": best["met"], "pours": sum(map(len, runs))}
    surface_csv = Path(surface_dir) / "dataset.csv"
    table, poured = _step(Path(surface_dir) / "samples.csv", surface_csv, targets)
    models = screening.models_of(table, poured, targets, "quadratic", surface_csv)
    others, means = surface.alternatives(models, table, space, targets, config)
    steps = (
        f"Screening: {config['response_surface']['screening_runs']} runs of a Plackett-Burman design and "
        f"{config['response_surface']['centres']} of the centre; "
        f"kept: {', '.join(best['coded'])}.",
        "Steepest ascent towards the targets, to the best point of the path.",
        f"Surface: {len(table)} parameter sets about it ({config['response_surface']['surface']}), a quadratic "
        "model for each response, and its optimum.",
        f"Check: the optimum was poured {len(runs[-1])} more times. {details['pours']} pours in all.",
    )
    values = np.array([best["parameters"][name] for name in space.names])
    mean = predicted.set_index("response").loc[list(targets.names), "predicted"].to_numpy(float)
    result = answer.Result(values, mean, others, means, steps)
    answer.write(result, runs[-1], space, targets, out_dir, details)
    return check


def _step(samples_csv, dataset_csv, targets):
    """Samples and dataset of a step."""
    table = read_table(samples_csv, ("sample", *PARAMETERS))
    if not any(name.startswith(CODED) for name in table):
        raise InputError(samples_csv, "columns", list(table), f"at least one column that begins with {CODED}")
    return table, read_table(dataset_csv, ("sample", "status", *PARAMETERS, *targets.names))


def _write(tables, out_dir):
    """The tables of an analysis."""
    for name, table in tables._asdict().items():
        write_table(Path(out_dir) / f"{name}.csv", table)
