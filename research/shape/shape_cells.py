"""Cells of the shape study and the settings of each.

A cell is a particle with a tension and a filling (`shape_rule.CELL`), poured for a purpose, its kind.
"""

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from repose.bench.parameters import PARAMETERS
from repose.calibrate.targets import Target, Targets
from repose.common.errors import InputError
from repose.common.files import read_table
from repose.config.pipeline import PipelineConfig
from repose.measure.further_responses import BENCH
from repose.stages.published import find_published_responses
from research.settings import SECTIONS
from research.shape.shape_rule import CELL

Config = Mapping[str, Any]
CYLINDER = "cylinder"
# Kinds of cells: the number of seeds in the configuration, and the purpose of the seeds.
KINDS = {
    "published": ("seeds", "shape_published"),
    "bulk": ("bulk_seeds", "shape_bulk"),
    "fresh": ("fresh_seeds", "shape_fresh"),
    "design": ("design_seeds", "shape_design"),
}
SENSITIVITY = ("fresh_seeds", "shape_sensitivity")


def first_cells(config: Config) -> list[str]:
    """Names KIND-PARTICLE-TENSION-FILLING of the jobs of the selection.

    The measuring cylinder is filled with the first tension alone: berries at rest hardly pull.
    """
    study = config["shape_study"]
    names = []
    for particle in study["particles"]:
        everywhere = particle in study["all_fillings_of"]
        fillings = study["fillings"] if everywhere else study["main_fillings"]
        for tension in study["tensions"]:
            names += [
                f"published-{particle}-{tension}-{filling}" for filling in fillings
            ]
    return names + [
        f"bulk-{particle}-{study['tensions'][0]}-{CYLINDER}"
        for particle in study["particles"]
    ]


def second_cells(config: Config, finalists: pd.DataFrame) -> list[str]:
    """Names of the jobs with fresh seeds: the finalists, the reference, and the sensitivities of the first finalist.

    `finalists` has the columns `shape_rule.CELL`.
    """
    study = config["shape_study"]
    cells = [
        "-".join(row)
        for row in finalists[CELL].drop_duplicates().itertuples(index=False, name=None)
    ]
    names = [f"fresh-{cell}" for cell in dict.fromkeys([*cells, study["reference"]])]
    names += [f"design-{cell}" for cell in cells]
    return names + [
        f"{name}-{cell}" for cell in cells[:1] for name in study["sensitivities"]
    ]


def check(config: Config, source: str = "configuration") -> None:
    """Check every particle, filling and sensitivity of the study; an InputError names `source`."""
    study = config["shape_study"]
    for key, section in (
        ("main_fillings", "fillings"),
        ("all_fillings_of", "particles"),
    ):
        for name in study[key]:
            if name not in study[section]:
                allowed = "some of " + ", ".join(study[section])
                raise InputError(source, f"shape_study.{key}", name, allowed)
    for kind in set(KINDS) & set(study["sensitivities"]):
        raise InputError(
            source,
            "shape_study.sensitivities",
            kind,
            "names besides " + ", ".join(KINDS),
        )
    if not _is_cell(config, f"fresh-{study['reference']}"):
        raise InputError(
            source,
            "shape_study.reference",
            study["reference"],
            "PARTICLE-TENSION-FILLING",
        )
    plain = {key: value for key, value in config.items() if key not in SECTIONS}
    for section, part in (
        ("particles", "berry"),
        ("fillings", "funnel"),
        ("sensitivities", "funnel"),
    ):
        for name, changes in study[section].items():
            PipelineConfig.of(
                changed(plain, part, changes), f"{source}, shape_study.{section}.{name}"
            )


def changed(config: Config, section: str, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Copy the configuration with some keys of a section changed."""
    other = copy.deepcopy(dict(config))
    other[section] = other[section] | changes
    return other


def compared_targets(config: Config) -> list[Target]:
    """Targets that are compared: those of the pile that the published table has, in their order.

    InputError if the configuration names no published table, or the table has none of them.
    """
    path = config["validation"]["published"]
    if path is None:
        raise InputError(
            "configuration",
            "validation.published",
            None,
            "the table of published solutions",
        )
    pile = [
        target
        for target in Targets.of(config["targets"])
        if target.response.apparatus == BENCH
    ]
    columns = read_table(path, ("solution", *PARAMETERS))
    published = find_published_responses(columns, [target.response for target in pile])
    if not published:
        raise InputError(
            path,
            "columns",
            list(columns),
            "some target's predicted and simulated values",
        )
    return [target for target in pile if target.response in published]


def parameter_sets(config: Config, samples_csv: str | Path, kind: str) -> pd.DataFrame:
    """Parameter sets of a kind of job: ``set``, the six parameters, and the published piles where there are some.

    `samples_csv` is the table of the design's samples.
    """
    if kind == "design":
        table = read_table(samples_csv, ("sample", *PARAMETERS)).head(
            config["shape_study"]["design_samples"]
        )
        return table.rename(columns={"sample": "set"})[["set", *PARAMETERS]]
    table = published_sets(config)
    return table if kind in ("published", "fresh") else table.tail(1)


def published_sets(config: Config) -> pd.DataFrame:
    """Read the published solutions, the representative last, with the published numbers of their piles.

    For a solution without a published pile the values of the physical pile are taken, which it nearly meets.
    """
    targets = compared_targets(config)
    simulated = [target.response.simulated for target in targets]
    table = read_table(
        config["validation"]["published"], ("solution", *PARAMETERS, *simulated)
    )
    table = table.rename(columns={"solution": "set"})
    table["set"] = table["set"].astype(str)
    for column, target in zip(simulated, targets, strict=True):
        table[column] = table[column].fillna(target.value)
    named = table["set"] == "representative"
    return pd.concat([table[~named], table[named]])[["set", *PARAMETERS, *simulated]]


def _is_cell(config, cell):
    """Whether a name is that of a cell of the study."""
    study = config["shape_study"]
    parts = cell.split("-")
    if len(parts) != 4:
        return False
    kind, particle, tension, filling = parts
    known = filling == CYLINDER if kind == "bulk" else filling in study["fillings"]
    return (
        known
        and kind in (*KINDS, *study["sensitivities"])
        and particle in study["particles"]
        and tension in study["tensions"]
    )


def cell_settings(
    config: Config, cell: str
) -> tuple[str, dict[str, str], dict[str, Any]]:
    """Kind of a cell KIND-PARTICLE-TENSION-FILLING, its names by `shape_rule.CELL`, and its configuration.

    InputError if there is no such cell.
    """
    if not _is_cell(config, cell):
        allowed = "KIND-PARTICLE-TENSION-FILLING of the section shape_study"
        raise InputError("command line", "--cell", cell, allowed)
    kind, *names = cell.split("-")
    particle, tension, filling = names
    study = config["shape_study"]
    changes = study["fillings"].get(filling, {}) | study["sensitivities"].get(kind, {})
    config = changed(config, "berry", study["particles"][particle])
    config = changed(config, "simulation", {"tension": tension})
    return kind, dict(zip(CELL, names, strict=True)), changed(config, "funnel", changes)


def dependencies(config: Config, cell: str) -> dict[str, Any]:
    """List the settings on which the pours and measurements of a cell depend."""
    kind, _, cell_config = cell_settings(config, cell)
    numbers = [KINDS.get(kind, SENSITIVITY)[0]]
    if kind == "design":
        numbers.append("design_samples")
    found = {key: cell_config["shape_study"][key] for key in numbers}
    found["seed"] = cell_config["design"]["seed"]
    # the bench test without its seeds, which the study replaces by its own
    bench_test = CYLINDER if kind == "bulk" else BENCH
    section = cell_config[bench_test].items()
    found[bench_test] = {key: value for key, value in section if key != "seeds"}
    for key in ("berry", "wall", "simulation", "measure", "targets"):
        found[key] = cell_config[key]
    return found
