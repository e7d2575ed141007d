"""Which particle, which definition of the angle, which filling: every combination at the published solutions.

A publication gives parameter sets with the piles that they made in its simulator. It may leave open what its particle,
its funnel and its angle were in detail. Here each particle (`shape_study.particles`, changes of the section `berry`) is
poured in each way (`shape_study.fillings`, changes of `funnel`) with each published set and several seeds, and every
pile is measured by all definitions. `repose.studies.shape_tables` says how a combination is judged.
"""

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from repose.apparatus.settings import SimulationSettings
from repose.config import checks
from repose.core.errors import InputError
from repose.core.files import read_json, read_table, write_json, write_table
from repose.core.parameters import PARAMETERS
from repose.core.published import published_responses
from repose.core.seeds import pour_seeds
from repose.core.targets import Target, Targets
from repose.measure.further_responses import BENCH
from repose.particle.particle import Particle
from repose.studies import shape_tables

Config = Mapping[str, Any]


def cells(config: Config) -> list[str]:
    """Names KIND-PARTICLE-FILLING of the study's jobs.

    Parameters
    ----------
    config : mapping

    Returns
    -------
    list of str
    """
    study = config["shape_study"]
    names = [
        f"published-{particle}-{filling}" for particle in study["particles"] for filling in study["fillings"]
    ]
    names += [f"sensitivity-{study['sensitivity_particle']}-{name}" for name in study["sensitivities"]]
    return names + [
        f"design-{particle}-{filling}"
        for filling in study["design_fillings"]
        for particle in study["particles"]
    ]


def check(config: Config, source: str = "configuration") -> None:
    """Check every particle, filling and sensitivity of the study.

    Parameters
    ----------
    config : mapping
    source : str, optional
        Named in the error.

    Raises
    ------
    InputError
        If one of them is no good configuration.
    """
    study = config["shape_study"]
    for key, section in (("sensitivity_particle", "particles"), ("sensitivity_filling", "fillings")):
        if study[key] not in study[section]:
            allowed = "one of " + ", ".join(study[section])
            raise InputError(source, f"shape_study.{key}", study[key], allowed)
    for filling in study["design_fillings"]:
        if filling not in study["fillings"]:
            allowed = "some of " + ", ".join(study["fillings"])
            raise InputError(source, "shape_study.design_fillings", filling, allowed)
    for section, part in (("particles", "berry"), ("fillings", "funnel"), ("sensitivities", "funnel")):
        for name, changes in study[section].items():
            checks.check(changed(config, part, changes), f"{source}, shape_study.{section}.{name}")


def changed(config: Config, section: str, changes: Mapping[str, Any]) -> dict[str, Any]:
    """A copy of the configuration with some keys of a section changed.

    Parameters
    ----------
    config : mapping
    section : str
        Name of the section.
    changes : mapping
        Values by key.

    Returns
    -------
    dict
    """
    other = copy.deepcopy(dict(config))
    other[section] = other[section] | changes
    return other


def compared_targets(config: Config) -> list[Target]:
    """Targets that are compared: those of the pile that the published table has, in their order.

    Parameters
    ----------
    config : mapping

    Returns
    -------
    list of Target

    Raises
    ------
    InputError
        If the configuration names no published table, or the table has none of them.
    """
    path = config["validation"]["published"]
    if path is None:
        raise InputError("configuration", "validation.published", None, "the table of published solutions")
    pile = [one for one in Targets.of(config["targets"]) if one.response.apparatus == BENCH]
    columns = read_table(path, ("solution", *PARAMETERS))
    there = published_responses(columns, [one.response for one in pile])
    if not there:
        raise InputError(path, "columns", list(columns), "some target's predicted and simulated values")
    return [one for one in pile if one.response in there]


def parameter_sets(config: Config, samples_csv: str | Path, kind: str) -> pd.DataFrame:
    """Parameter sets of a kind of job.

    Parameters
    ----------
    config : mapping
    samples_csv : path
        Table of the design's samples.
    kind : str
        Of the job.

    Returns
    -------
    pandas.DataFrame
        ``set``, the six parameters, and the published piles where there are some.
    """
    if kind == "design":
        table = read_table(samples_csv, ("sample", *PARAMETERS)).head(config["shape_study"]["design_samples"])
        return table.rename(columns={"sample": "set"})[["set", *PARAMETERS]]
    table = published_sets(config)
    return table.tail(1) if kind == "sensitivity" else table


def published_sets(config: Config) -> pd.DataFrame:
    """The published solutions, the representative last, with the published numbers of their piles.

    A solution without a published pile is known only as nearly the physical pile, which stands for it.

    Parameters
    ----------
    config : mapping

    Returns
    -------
    pandas.DataFrame
    """
    targets = compared_targets(config)
    simulated = [one.response.simulated for one in targets]
    table = read_table(config["validation"]["published"], ("solution", *PARAMETERS, *simulated))
    table = table.rename(columns={"solution": "set"})
    table["set"] = table["set"].astype(str)
    for column, one in zip(simulated, targets, strict=True):
        table[column] = table[column].fillna(one.value)
    named = table["set"] == "representative"
    return pd.concat([table[~named], table[named]])[["set", *PARAMETERS, *simulated]]


def cell_settings(config: Config, cell: str) -> tuple[str, str, str, dict[str, Any]]:
    """Settings of a cell.

    Parameters
    ----------
    config : mapping
    cell : str
        One of `cells`.

    Returns
    -------
    kind, particle, filling : str
        Names.
    config : dict
        Of the cell.

    Raises
    ------
    InputError
        If there is no such cell.
    """
    kind, _, rest = cell.partition("-")
    particle, _, filling = rest.partition("-")
    if cell not in cells(config):
        raise InputError("command line", "--cell", cell, "one of " + ", ".join(cells(config)))
    study = config["shape_study"]
    changes = study["fillings"].get(filling, {})
    if kind == "sensitivity":
        changes = study["fillings"][study["sensitivity_filling"]] | study["sensitivities"][filling]
    config = changed(config, "berry", study["particles"][particle])
    return kind, particle, filling, changed(config, "funnel", changes)


def dependencies(config: Config, cell: str) -> dict[str, Any]:
    """Settings on which the pours and measurements of a cell depend.

    Parameters
    ----------
    config : mapping
    cell : str
        One of `cells`.

    Returns
    -------
    dict
    """
    kind, _, _, own = cell_settings(config, cell)
    seeds = ("design_samples", "design_seeds") if kind == "design" else ("seeds",)
    found = {key: own["shape_study"][key] for key in seeds} | {"seed": own["design"]["seed"]}
    funnel = {key: value for key, value in own["funnel"].items() if key != "seeds"}
    kept = ("berry", "wall", "simulation", "measure", "targets")
    return found | {"funnel": funnel} | {key: own[key] for key in kept}


def poured(
    config: Config, cell: str, sets: pd.DataFrame, particle: Particle, berry: Mapping[str, Any]
) -> pd.DataFrame:
    """Pour and measure all sets of a cell with all their seeds.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    cell : str
        Name of the cell.
    sets : pandas.DataFrame
        Of `parameter_sets`.
    particle : Particle
        The cell's.
    berry : mapping
        What the verb berry wrote.

    Returns
    -------
    pandas.DataFrame
        A row for each pour, with the columns of `shape_tables.run_columns`.
    """
    from repose.apparatus import bench
    from repose.apparatus.job import run_once

    kind, name, filling, own = cell_settings(config, cell)
    columns = shape_tables.run_columns(compared_targets(config))
    count = own["shape_study"]["design_seeds" if kind == "design" else "seeds"]
    rows = []
    for number, one in enumerate(sets.to_dict("records")):
        for seed in pour_seeds(own["design"]["seed"], f"shape_{kind}", number, count):
            record, _ = run_once(bench(BENCH), own, one, seed, particle, berry)
            about = {"kind": kind, "particle": name, "filling": filling, "set": one["set"]}
            rows.append(about | {key: record[key] for key in columns if key in record})
    return pd.DataFrame(rows, columns=list(columns))


def run_cell(
    config: Config, cell: str, berry_json: str | Path, samples_csv: str | Path, out_dir: str | Path
) -> None:
    """Pour and measure one cell; write OUT/CELL.csv of its pours and OUT/CELL.json of its particle.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    cell : str
        Name of the cell.
    berry_json : path
        What the verb berry wrote.
    samples_csv : path
        The design.
    out_dir : path

    Raises
    ------
    InputError
        If a file is bad, or the study has no such cell.
    """
    from repose.particle import build

    kind, name, _, own = cell_settings(config, cell)
    section, out = own["berry"], Path(out_dir)
    particle = build.run(
        berry_json,
        section["stl"],
        out / "particles" / cell,
        kind=section["particle"],
        mass_g=section["mass_g"],
        spheres=section["spheres"],
        surface=section["surface"],
        time_step_s=SimulationSettings.of(own).time_step_s,
    )
    berry = read_json(berry_json, ("long_mm", "major_mm", "minor_mm"), "what the verb berry wrote")
    about = {
        "particle": name,
        "axes_mm": (1e3 * particle.axes_m).tolist(),
        "mass_g": 1e3 * particle.mass_kg,
        "volume_mm3": 1e9 * particle.volume_m3,
        "measured_axes_mm": [berry[key] for key in ("long_mm", "major_mm", "minor_mm")],
    }
    write_json(out / f"{cell}.json", about)
    table = poured(config, cell, parameter_sets(own, samples_csv, kind), particle, berry)
    write_table(out / f"{cell}.csv", table)


def run_tables(config: Config, cell_csvs: list[str | Path], out_dir: str | Path) -> dict[str, Any]:
    """Write sets.csv, combinations.csv, noise.csv, particles.csv and choice.json; return them by name.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    cell_csvs : list of path
        What `run_cell` wrote, the JSON files beside them.
    out_dir : path

    Returns
    -------
    dict
        The tables, and the content of choice.json as ``choice``.

    Raises
    ------
    InputError
        If a file is bad.
    """
    targets = compared_targets(config)
    columns = shape_tables.run_columns(targets)
    runs = pd.concat([read_table(path, columns) for path in cell_csvs], ignore_index=True)
    keys = ("particle", "axes_mm", "measured_axes_mm", "mass_g", "volume_mm3")
    abouts = [
        read_json(Path(path).with_suffix(".json"), keys, "a file of the verb shape_cell")
        for path in cell_csvs
    ]
    mass_g = config["shape_study"]["measured_mass_g"]
    tables, choice = shape_tables.tables_of(runs, abouts, published_sets(config), targets, mass_g)
    for name, table in tables.items():
        write_table(Path(out_dir) / f"{name}.csv", table, float_format="%.6g")
    write_json(Path(out_dir) / "choice.json", choice)
    return tables | {"choice": choice}
