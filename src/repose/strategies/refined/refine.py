"""The loop closed: the search's answer is simulated, added to the data, the surrogate refitted, the search run again.

Round 0 simulates the proposal of the main chain. Every round runs its proposal with many fresh seeds and a few
neighbours with fewer, and is judged by the simulated means of the proposal alone (`repose.strategies.refined.rounds`).
As long as these miss a target, all points so far join the training samples, the refitted surrogate is corrected near
the last proposal, and the search runs again there: docs/refinement.md says why.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.chain import invert
from repose.chain.dataset import read_definitions
from repose.chain.design import lhsdesign
from repose.chain.train import read_surrogate
from repose.core.errors import InputError
from repose.core.files import read_table, write_json, write_table
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS, named
from repose.core.responses import Definitions, require_same_definitions
from repose.core.seeds import PURPOSES
from repose.core.targets import Targets
from repose.strategies.refined.rounds import NEIGHBOUR, OF_A_ROUND, PROPOSAL, jobs, round_of
from repose.surrogate.base import Surrogate
from repose.surrogate.support import Support

WIDENING = (0.125, 0.25, 0.5, 1.0)  # shares of the box, tried in this order
MET = 0.1  # a prediction this share of the tolerance from the target meets it
ROUNDING = 1e-9  # of a place in the box, in ranges


def search_box(space: ParameterSpace, centre: Mapping[str, float], reach: float) -> ParameterSpace:
    """The ranges narrowed to a box about `centre`; `reach` is half the width of the box, in ranges."""
    middle = np.array([float(centre[name]) for name in space.free])
    step = reach * (space.high - space.low)
    return replace(
        space, low=np.maximum(space.low, middle - step), high=np.minimum(space.high, middle + step)
    )


def propose(
    solutions: pd.DataFrame,
    model: Surrogate,
    space: ParameterSpace,
    targets: Targets,
    section: Mapping[str, Any],
    round_: int,
    study_seed: int,
) -> pd.DataFrame:
    """The jobs of a round: the representative of `solutions` (feasible.csv), and neighbours around it.

    The neighbours are a Latin hypercube in the box in which the next round searches.
    """
    best = solutions[solutions["representative"]].iloc[0]
    table = pd.DataFrame(jobs(section, round_), columns=["sample", "role", "seeds"])
    near = table["role"] == NEIGHBOUR
    for name in space.names:
        table[name] = float(best[name])
    if near.any() and space.dimensions:
        rng = np.random.default_rng([study_seed, PURPOSES["refine"], OF_A_ROUND * (round_ + 1)])
        unit = lhsdesign(int(near.sum()), space.dimensions, rng=rng)
        table.loc[near, list(space.names)] = search_box(space, best, section["reach"]).values(unit)
    table[list(targets.predicted)] = model.predict(table[list(space.names)].to_numpy(float))
    warning = best.get("warning", "")
    table["warning"] = np.where(near, "", "" if pd.isna(warning) else warning)
    return table[["sample", *space.names, "role", "seeds", *targets.predicted, "warning"]]


def extended(design: pd.DataFrame, rounds: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """The samples, or runs, of a design and of all rounds as one table; `round` is empty for the design's own rows.

    ValueError if a sample is there twice, or is numbered like the design's.
    """
    added = pd.concat(rounds, ignore_index=True)
    added["round"] = round_of(added["sample"])
    if (added["round"] < 0).any() or design["sample"].max() >= OF_A_ROUND:
        raise ValueError(f"samples are numbered alike; allowed: below {OF_A_ROUND} in the design alone")
    owners = [set(table["sample"]) for table in rounds]
    if len(set().union(*owners)) < sum(map(len, owners)):
        raise ValueError("rounds hold a sample twice; allowed: each round once")
    return pd.concat([design, added], ignore_index=True).astype({"round": "Int64"})


def corrected(
    model: Surrogate, dataset: pd.DataFrame, box: ParameterSpace, targets: Targets
) -> tuple[Surrogate, np.ndarray, int]:
    """A copy of the surrogate, shifted by the mean residual of the refined samples inside a box, weighted by seeds.

    The refit follows the whole design and keeps a few percent of error where it matters. Also returns the offset (k,)
    and its number of samples; ValueError without any.
    """
    added = dataset[dataset["round"].notna() & (dataset["status"] == "ok")]
    points = added[list(box.free)].to_numpy(float)
    slack = ROUNDING * (box.high - box.low)
    inside = ((points >= box.low - slack) & (points <= box.high + slack)).all(axis=1)
    if not inside.any():
        raise ValueError("no usable refined sample inside the box; allowed: at least one")
    near = added[inside]
    left = near[list(targets.names)].to_numpy(float) - model.predict(near[list(box.names)].to_numpy(float))
    offset = np.average(left, axis=0, weights=near["n_seeds"].to_numpy(float))
    return model.shifted(offset), offset, len(near)


def search(
    model: Surrogate,
    dataset: pd.DataFrame,
    centre: Mapping[str, float],
    space: ParameterSpace,
    targets: Targets,
    config: Mapping[str, Any],
    published: pd.DataFrame | None = None,
    support: Support | None = None,
) -> tuple[Surrogate, invert.Inversion]:
    """Correct a surrogate, refitted to `dataset` (of `extended`), near the last proposal `centre`, and search there.

    The search begins in an eighth of the box of `refine.reach` and widens it until the targets are met: of all suitable
    parameter sets, one near the last proposal is wanted, where the correction holds.
    """
    reach, tolerance = config["refine"]["reach"], config["refine"]["tolerance_percent"] / 100
    model, offset, count = corrected(model, dataset, search_box(space, centre, reach), targets)
    for share in WIDENING:
        box = search_box(space, centre, share * reach)
        inversion = invert.invert(model, box, targets, config["miga"], published, support)
        off = [inversion.summary["target_distance"][target.name] / target.whole for target in targets]
        if max(off) < tolerance * MET:
            break
    near = {"reach": share * reach, "offset": dict(zip(targets.names, offset.tolist(), strict=True))}
    return model, replace(inversion, summary=inversion.summary | near | {"offset_samples": count})


# --- on files ------------------------------------------------------------------------------------


def run_propose(
    feasible_csv: str | os.PathLike,
    surrogate_json: str | os.PathLike,
    space: ParameterSpace,
    targets: Targets,
    section: Mapping[str, Any],
    round_: int,
    study_seed: int,
    out_csv: str | os.PathLike,
    definitions: Definitions | None = None,
    source: object = "configuration",
) -> pd.DataFrame:
    """Write and return the jobs of a round (`propose`); InputError, with `source`, for other `definitions`."""
    if round_ < 0:
        raise InputError("command line", "--round", round_, "0 or more")
    feasible = read_table(feasible_csv, ("solution", *PARAMETERS, "representative"))
    if feasible["representative"].sum() != 1:
        raise InputError(
            feasible_csv, "representative", int(feasible["representative"].sum()), "one solution"
        )
    model = read_surrogate(surrogate_json, targets, definitions or {}, source)
    table = propose(feasible, model, space, targets, section, round_, study_seed)
    write_table(out_csv, table)
    return table


def run_extended(
    dataset_csv: str | os.PathLike,
    runs_csv: str | os.PathLike,
    round_dirs: Sequence[str | os.PathLike],
    out_dir: str | os.PathLike,
) -> dict[str, pd.DataFrame]:
    """Write dataset.csv, runs.csv (`extended`) and dataset_summary.json, the definitions; return the tables by name.

    InputError for a sample that is there twice, or a round with other definitions than the design.
    """
    definitions, design_json = read_definitions(dataset_csv)
    for folder in round_dirs:
        own, round_json = read_definitions(Path(folder) / "dataset.csv")
        require_same_definitions(own, round_json, definitions, design_json)
    tables = {}
    for name, path in (("dataset", dataset_csv), ("runs", runs_csv)):
        files = [Path(folder) / f"{name}.csv" for folder in round_dirs]
        design, rounds = read_table(path, ("sample",)), [read_table(file, ("sample",)) for file in files]
        try:
            tables[name] = extended(design, rounds)
        except ValueError as error:
            raise InputError(path, "sample", str(error), "numbers of repose stage refine_propose") from None
        write_table(Path(out_dir) / f"{name}.csv", tables[name])
    write_json(Path(out_dir) / "dataset_summary.json", {"definitions": definitions})
    return tables


def centre_of(proposal_csv: str | os.PathLike) -> dict[str, float]:
    """Parameters by name of the proposal in a file of `run_propose`; without a proposal InputError."""
    table = read_table(proposal_csv, ("sample", *PARAMETERS, "role"))
    own = table[table["role"] == PROPOSAL]
    if own.empty:
        raise InputError(proposal_csv, "role", sorted(set(table["role"])), f"a {PROPOSAL}")
    return own.iloc[0][list(named(own))].astype(float).to_dict()


def run_search(
    surrogate_json: str | os.PathLike,
    dataset_csv: str | os.PathLike,
    proposal_csv: str | os.PathLike,
    space: ParameterSpace,
    targets: Targets,
    config: Mapping[str, Any],
    table3_csv: str | os.PathLike | None,
    out_dir: str | os.PathLike,
    definitions: Definitions | None = None,
    source: object = "configuration",
) -> dict[str, Any]:
    """Write the corrected surrogate, network.json, and the files of `search`; return the summary of the search.

    InputError for other responses or definitions than the targets', or no usable sample near the last proposal.
    """
    columns = ("sample", *PARAMETERS, "status", *targets.names, "n_seeds", "round")
    dataset = read_table(dataset_csv, columns)
    model = read_surrogate(surrogate_json, targets, definitions or {}, source)
    published = None if table3_csv is None else read_table(table3_csv, ("parameter", *invert.INTERVAL))
    centre, support = centre_of(proposal_csv), Support.of_dataset(dataset_csv, space)
    try:
        model, inversion = search(model, dataset, centre, space, targets, config, published, support)
    except InputError:
        raise
    except ValueError as error:
        raise InputError(dataset_csv, "samples", str(error), "data of the last round") from None
    model.save(Path(out_dir) / "network.json")
    invert.write(inversion, out_dir)
    return inversion.summary
