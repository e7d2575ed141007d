"""Choice of particle, tension, filling and definition of the angle: combinations at the published solutions.

A publication gives parameter sets with the piles that they made in its simulator. It may leave open the details of its
particle, its contact law's tension, its funnel and its angle. Here each particle (`shape_study.particles`, changes of
the section `berry`) is poured with each tension in several ways (`shape_study.fillings`, changes of `funnel`) with each
published set, and every pile is measured by all definitions. A measuring cylinder is filled with each particle, too.
`research.shape.shape_rule` says how a few finalists are selected; these are poured again with fresh seeds, and one of
them is chosen.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from repose.bench import Scene
from repose.calibrate.seeds import draw_run_seeds
from repose.common import provenance
from repose.common.errors import NoFlankError
from repose.common.files import read_json, read_table, write_json, write_table
from repose.config.computed import advise_time_step_s, find_longest_step
from repose.grain.berry_files import read_grain
from repose.grain.particle import Particle
from repose.measure.further_responses import BENCH, CALIBRATED_ANGLE
from repose.measure.settings import MeasureSettings
from research.shape import shape_piles, shape_tables
from research.shape.shape_cells import (
    CYLINDER,
    KINDS,
    SENSITIVITY,
    Config,
    cell_settings,
    changed,
    compared_targets,
    parameter_sets,
    published_sets,
)
from research.shape.shape_rule import COMBINATION
from research.streams import STREAMS

# Keys that are kept of a cell's particle.
ABOUT = (
    "particle",
    "spheres",
    "axes_mm",
    "measured_axes_mm",
    "mass_g",
    "volume_mm3",
    "deviation_rms_mm",
    "deviation_max_mm",
)


def poured(
    config: Config,
    cell: str,
    sets: pd.DataFrame,
    particle: Particle,
    berry: Mapping[str, Any],
    kept: Path | None = None,
) -> pd.DataFrame:
    """Pour and measure all sets of a cell with all their seeds.

    A row for each pour, with the columns of `shape_tables.run_columns`. `sets` are of `parameter_sets`, `berry` is the
    result of the verb berry. `kept` is a folder of kept runs (`repose.stages.kept_runs`), so that none is made
    twice; None keeps none.
    """
    kind, names, cell_config = cell_settings(config, cell)
    key, purpose = KINDS.get(kind, SENSITIVITY)
    columns = shape_tables.run_columns(compared_targets(config))
    rows = []
    for number, row in enumerate(sets.to_dict("records")):
        for seed in draw_run_seeds(
            cell_config["design"]["seed"],
            STREAMS[purpose],
            number,
            cell_config["shape_study"][key],
        ):
            name = f"{cell}_{number}"
            record = _one_pour(
                cell_config, kind, row, seed, particle, berry, kept, name
            )
            labels = {"kind": kind, **names, "set": row["set"]}
            rows.append(labels | {key: record[key] for key in columns if key in record})
    return pd.DataFrame(rows, columns=list(columns))


def _one_pour(config, kind, parameters, seed, particle, berry, folder, name):
    """Make the record of one pour with its measurements."""
    from repose.bench import bench

    test = bench(CYLINDER if kind == "bulk" else BENCH)
    scene = Scene.of(config, parameters, berry, particle, seed)
    run = _kept_run(test, scene, folder, name)
    if kind == "bulk":
        return test.measure(
            run.record, run.arrays, Scene.of(config, {}, berry, particle)
        )
    if run.record["status"] != "ok":
        return run.record
    measured = {}
    if {target.name for target in compared_targets(config)} - {
        CALIBRATED_ANGLE,
        "height_mm",
    }:
        measured = test.measure(
            run.record, run.arrays, Scene.of(config, {}, berry, particle)
        )
    try:
        settings = MeasureSettings.with_defaults(**config["measure"]).for_grain(berry)
        return (
            run.record | measured | shape_piles.measured(run.arrays, particle, settings)
        )
    except NoFlankError as error:
        return run.record | {"status": "no_flank", "reason": error.reason}


def _kept_run(test, scene, folder, name):
    """Return the kept run of a scene if it is the same, or else a new run.

    A new run is kept in the folder, unless that is None.
    """
    from repose.stages.job import describe_job
    from repose.stages.kept_runs import KeptRuns

    if folder is None:
        return test.run(scene)
    kept_runs = KeptRuns(folder, name, describe_job(test, scene, name))
    run = kept_runs.read(scene.seed)
    if run is None:
        run = test.run(scene)
        kept_runs.write(run)
    return run


def run_cell(
    config: Config,
    cell: str,
    berry_json: str | Path,
    samples_csv: str | Path,
    out_dir: str | Path,
) -> None:
    """Pour and measure one cell; write OUT/CELL.csv of its pours and OUT/CELL.json of its particle.

    `samples_csv` is the design. InputError if the study has no such cell.
    """
    from repose.grain import build

    kind, names, cell_config = cell_settings(config, cell)
    section = cell_config["berry"]
    out = Path(out_dir)
    particle = build.run(
        berry_json,
        section["stl"],
        out / "particles" / cell,
        kind=section["particle"],
        mass_g=section["mass_g"],
        spheres=section["spheres"],
        surface=section["surface"],
    )
    berry = read_grain(berry_json)
    # the study's own particle may bear more
    longest_s = advise_time_step_s(
        find_longest_step(cell_config, particle, berry).time_step_s
    )
    config = changed(
        config,
        "simulation",
        {"time_step_s": min(cell_config["simulation"]["time_step_s"], longest_s)},
    )
    # this cell does not depend on other cells' settings
    provenance.note_config(cell_settings(config, cell)[2])
    facts = {
        "particle": names["particle"],
        "spheres": len(particle.spheres_m),
        "axes_mm": (1e3 * particle.axes_m).tolist(),
        "mass_g": 1e3 * particle.mass_kg,
        "volume_mm3": 1e9 * particle.volume_m3,
        "deviation_rms_mm": 1e3 * particle.deviation_rms_m,
        "deviation_max_mm": 1e3 * particle.deviation_max_m,
        "measured_axes_mm": [berry[key] for key in ("long_mm", "major_mm", "minor_mm")],
    }
    write_json(out / f"{cell}.json", facts)
    table = poured(
        config,
        cell,
        parameter_sets(cell_config, samples_csv, kind),
        particle,
        berry,
        out,
    )
    write_table(out / f"{cell}.csv", table)


def read_cells(config: Config, cell_csvs: Iterable[str | Path]) -> shape_tables.Study:
    """Read the study of some cells from the CSV files of `run_cell` and the JSON files beside them."""
    targets = compared_targets(config)
    paths = [Path(path) for path in cell_csvs]
    columns = shape_tables.run_columns(targets)
    runs = pd.concat([read_table(path, columns) for path in paths], ignore_index=True)
    cells = [
        read_json(path.with_suffix(".json"), ABOUT, "a file of the part cell")
        for path in paths
    ]
    listed = list(config["shape_study"]["particles"])
    cells.sort(key=lambda entry: listed.index(entry["particle"]))
    measured = (
        config["shape_study"]["measured_mass_g"],
        config["berry"]["density_kg_m3"],
    )
    return shape_tables.Study(runs, cells, published_sets(config), targets, *measured)


def run_selection(
    config: Config, cell_csvs: Iterable[str | Path], out_dir: str | Path
) -> None:
    """Write particles.csv, piles.csv, sets.csv, combinations.csv and finalists.csv.

    `cell_csvs` are those of the first cells.
    """
    for name, table in read_cells(config, cell_csvs).selection().items():
        write_table(Path(out_dir) / f"{name}.csv", table, float_format="%.6g")


def run_verdict(
    config: Config,
    cell_csvs: Iterable[str | Path],
    finalists_csv: str | Path,
    out_dir: str | Path,
) -> dict[str, Any]:
    """Write fresh.csv, fresh_sets.csv, noise.csv and choice.json; return the choice.

    `cell_csvs` are those of all cells, `finalists_csv` is of `run_selection`.
    """
    finalists = read_table(finalists_csv, (*COMBINATION, "distance", "role"))
    tables, choice = read_cells(config, cell_csvs).verdict(finalists)
    for name, table in tables.items():
        write_table(Path(out_dir) / f"{name}.csv", table, float_format="%.6g")
    write_json(Path(out_dir) / "choice.json", choice)
    return choice
