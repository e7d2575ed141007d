"""The refinement of `repose.studies.refine` on files."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from repose.chain import invert
from repose.chain.dataset import read_definitions
from repose.core.errors import InputError
from repose.core.files import read_table, write_json, write_table
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS
from repose.core.responses import Definitions, require_same_definitions
from repose.core.targets import Targets
from repose.studies.refine import extended, propose, search
from repose.studies.rounds import PROPOSAL
from repose.studies.surrogates import read_surrogate
from repose.surrogate.support import Support


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
    """Write and return the jobs of a round; see `repose.studies.refine.propose`.

    `feasible_csv` is of the search, `surrogate_json` the searched surrogate. `definitions` are those of the study's
    responses; `source` names them in the error. InputError for other responses or definitions, or a negative round.
    """
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
    """Write dataset.csv and runs.csv of the design and of all rounds so far; return them by name.

    dataset_summary.json beside them holds the definitions of the responses. Each folder of a round has dataset.csv and
    runs.csv. InputError for a sample that is there twice, or a round with other definitions than the design.
    """
    definitions, design_json = read_definitions(dataset_csv)
    for folder in round_dirs:
        found, round_json = read_definitions(Path(folder) / "dataset.csv")
        require_same_definitions(found, round_json, definitions, design_json)
    tables = {}
    for name, path in (("dataset", dataset_csv), ("runs", runs_csv)):
        files = [Path(folder) / f"{name}.csv" for folder in round_dirs]
        design, rounds = read_table(path, ("sample",)), [read_table(file, ("sample",)) for file in files]
        try:
            tables[name] = extended(design, rounds)
        except ValueError as error:
            raise InputError(
                path, "sample", str(error), "numbers as the verb refine_propose gives them"
            ) from None
        write_table(Path(out_dir) / f"{name}.csv", tables[name])
    write_json(Path(out_dir) / "dataset_summary.json", {"definitions": definitions})
    return tables


def centre_of(proposal_csv: str | os.PathLike) -> dict[str, float]:
    """Parameters by name of the proposal in a file of `run_propose`; without a proposal InputError."""
    table = read_table(proposal_csv, ("sample", *PARAMETERS, "role"))
    own = table[table["role"] == PROPOSAL]
    if own.empty:
        raise InputError(proposal_csv, "role", sorted(set(table["role"])), f"a {PROPOSAL}")
    return own.iloc[0][list(PARAMETERS)].astype(float).to_dict()


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
    """Correct the surrogate near the last proposal and search there; return the summary of the search.

    The corrected surrogate is written as network.json, beside the files of `repose.chain.invert.write`.
    `surrogate_json` is the refitted surrogate, `dataset_csv` of `run_extended`, `table3_csv` the published intervals or
    None. InputError for other responses or definitions than the targets', or no usable sample near the last proposal.
    """
    columns = ("sample", *PARAMETERS, "status", *targets.names, "n_seeds", "round")
    dataset = read_table(dataset_csv, columns)
    model = read_surrogate(surrogate_json, targets, definitions or {}, source)
    published = None if table3_csv is None else read_table(table3_csv, ("parameter", *invert.INTERVAL))
    centre, support = centre_of(proposal_csv), Support.of_dataset(dataset_csv, space)
    try:
        model, found = search(model, dataset, centre, space, targets, config, published, support)
    except InputError:
        raise
    except ValueError as error:
        raise InputError(dataset_csv, "samples", str(error), "data of the last round") from None
    model.save(Path(out_dir) / "network.json")
    invert.write(found, out_dir)
    return found.summary
