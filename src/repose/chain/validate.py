"""Calibrated solutions simulated again: Table 4, the physical measurement, the published solutions in this engine.

Section 4.2.1 of the paper. Errors are relative, in percent, as in Table 4: |predicted - simulated| / simulated, and for
the representative solution |simulated - physical| / physical.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.chain.chance import PERCENT, chance_of_meeting
from repose.chain.dataset import Job, assemble, read_jobs
from repose.core.errors import InputError
from repose.core.files import check_columns, read_table, write_table
from repose.core.parameter_sets import read_samples
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS, named
from repose.core.published import can_be_simulated, published_responses
from repose.core.responses import Response, derived
from repose.core.targets import Targets
from repose.surrogate.support import Support

CHOSEN = ("origin", "solution", "role")
ENDED = ("n_seeds", "status", "reason")
FIRST_PUBLISHED = 101  # own solutions are numbered from 1, so the numbers cannot coincide


def solutions_to_simulate(
    feasible: pd.DataFrame,
    published: pd.DataFrame | None,
    space: ParameterSpace,
    targets: Targets,
    count: int,
) -> pd.DataFrame:
    """The representative solution and `count` other own ones, numbered from 1, and the published ones, from 101."""
    columns = ["sample", *space.names, *CHOSEN, *targets.predicted]
    own = select_for_validation(feasible, count, space)
    own["origin"], own["sample"] = "miga", range(1, len(own) + 1)
    parts = [own[columns]]
    if published is not None and can_be_simulated(published, targets.responses, space.names):
        reference = published.copy()
        reference["origin"] = "published"
        reference["sample"] = range(FIRST_PUBLISHED, FIRST_PUBLISHED + len(reference))
        named = reference["solution"].astype(str) == "representative"
        reference["role"] = named.map({True: "representative", False: "spread"})
        parts.append(reference.reindex(columns=columns))
    return pd.concat([part.astype({"solution": str}) for part in parts]).reset_index(drop=True)


def select_for_validation(solutions: pd.DataFrame, count: int, space: ParameterSpace) -> pd.DataFrame:
    """The representative solution, that of least objective, and others that are spread over the cloud.

    Each next solution is the farthest, in normalised parameters, from those already chosen (Gonzalez 1985); all are
    feasible if enough are.
    """
    if np.count_nonzero(solutions["feasible"]) > count:
        solutions = solutions[solutions["feasible"] | solutions["representative"]]
    points = 2 * space.unit(solutions[list(space.names)].to_numpy(float)) - 1
    chosen = [int(np.flatnonzero(solutions["representative"])[0])]
    roles = ["representative"]
    least = int(solutions["objective"].to_numpy(float).argmin())
    if least not in chosen:
        chosen.append(least)
        roles.append("least objective")
    while len(chosen) < min(count + 1, len(points)):
        nearest = np.linalg.norm(points[:, None] - points[chosen], axis=2).min(axis=1)
        nearest[chosen] = -1.0
        chosen.append(int(nearest.argmax()))
    picked = solutions.iloc[chosen].copy()
    picked["role"] = roles + ["spread"] * (len(chosen) - len(roles))
    return picked


def validate(
    solutions: pd.DataFrame,
    jobs: Mapping[str, Mapping[int, Job]],
    targets: Targets,
    published: pd.DataFrame | None = None,
    support: Support | None = None,
) -> dict[str, pd.DataFrame]:
    """Prediction, simulation and the physical measurement side by side."""
    simulated = assemble(solutions, jobs, targets)[0].drop(columns=["sample", *named(solutions)])
    simulated = simulated.rename(
        columns={response.name: response.simulated for response in targets.responses}
    )
    numbers = [column for response in targets.responses for column in (response.simulated, response.error)]
    simulated[numbers] = simulated[numbers].astype(float)  # None of a failed solution, or of one seed, to NaN
    rows = pd.concat([solutions.reset_index(drop=True), simulated], axis=1)

    own, reference = (rows[rows["origin"] == origin] for origin in ("miga", "published"))
    best = own[own["role"] == "representative"].iloc[0]
    runs = {bench: jobs[bench][best["sample"]]["runs"] for bench in targets.apparatus}
    tables = {
        "table4": table4(own, targets.responses),
        "representative": with_chances(against_physical(best, targets), runs, targets),
        "published": compared_with_published(reference, published, targets.responses),
    }
    if support is not None:
        for name in ("table4", "published"):
            parameters = tables[name][list(named(tables[name]))].to_numpy(float)
            tables[name]["warning"] = support.warnings(parameters) if len(parameters) else []
    return tables


def table4(rows: pd.DataFrame, responses: Iterable[Response]) -> pd.DataFrame:
    """Table 4: predicted, simulated with its standard error, and relative error (%) of each solution."""
    table = rows[["sample", "solution", "role", *named(rows)]].copy()
    for response in responses:
        table[response.predicted], table[response.simulated] = (
            rows[response.predicted],
            rows[response.simulated],
        )
        table[response.error] = rows[response.error]
        off = (rows[response.predicted] - rows[response.simulated]).abs()
        table[f"{response.quantity}_error_percent"] = 100 * off / rows[response.simulated]
    table[list(ENDED)] = rows[list(ENDED)]
    return table


def against_physical(row: pd.Series, targets: Targets) -> pd.DataFrame:
    """The representative solution's simulation against the physical measurement, a row for each response."""
    rows = []
    for target in targets:
        simulated = row[target.response.simulated]
        rows.append(
            {
                "response": target.name,
                "physical_mean": target.value,
                "physical_sd": target.sd,
                "predicted": row[target.response.predicted],
                "simulated": simulated,
                "simulated_se": row[target.response.error],
                "error_percent": 100 * abs(simulated - target.value) / target.whole_value,
                "within_one_sd": bool(abs(simulated - target.value) <= target.sd),
                "n_seeds": row["n_seeds"],
                "status": row["status"],
            }
        )
    return pd.DataFrame(rows)


def with_chances(
    table: pd.DataFrame, runs: Mapping[str, Sequence[Mapping[str, Any]]], targets: Targets
) -> pd.DataFrame:
    """The table of `against_physical` with the probabilities that all targets are met within 1 % and 2 %."""
    chances = {
        f"within_{percent:g}_percent": chance_of_meeting(runs, targets, percent)["all"] for percent in PERCENT
    }
    return table.assign(**chances)


def compared_with_published(
    rows: pd.DataFrame, published: pd.DataFrame | None, responses: Iterable[Response]
) -> pd.DataFrame:
    """The published solutions: published and own simulation, its standard error, and own minus published."""
    table = rows[["sample", "solution", *named(rows)]].copy()
    if published is not None:
        reference = published.astype({"solution": str}).set_index("solution").reindex(rows["solution"])
        for response in published_responses(published, responses):
            simulated = reference[response.simulated].to_numpy(float)
            table[derived(response.name, "published_predicted")] = rows[response.predicted]
            table[derived(response.name, "published_simulated")] = simulated
            table[response.simulated] = rows[response.simulated]
            table[response.error] = rows[response.error]
            table[derived(response.name, "difference")] = rows[response.simulated] - simulated
    table[list(ENDED)] = rows[list(ENDED)]
    return table


def write_solutions(
    feasible_csv: str | os.PathLike,
    published_csv: str | os.PathLike | None,
    space: ParameterSpace,
    targets: Targets,
    count: int,
    out_csv: str | os.PathLike,
) -> pd.DataFrame:
    """Write the parameter sets to simulate and return them (`solutions_to_simulate`); InputError if too few."""
    needed = ("solution", *space.names, *targets.predicted, "objective", "feasible", "representative")
    feasible = read_table(feasible_csv, needed)
    if len(feasible) < count + 1:
        raise InputError(feasible_csv, "solutions", len(feasible), f"at least {count + 1}")
    solutions = solutions_to_simulate(feasible, _published(published_csv), space, targets, count)
    write_table(out_csv, solutions)
    return solutions


def run(
    solutions_csv: str | os.PathLike,
    job_json_paths: Iterable[str | os.PathLike],
    published_csv: str | os.PathLike | None,
    targets: Targets,
    out_dir: str | os.PathLike,
    support: Support | None = None,
) -> dict[str, pd.DataFrame]:
    """Write table4.csv, representative.csv and published.csv (`validate`); return the three tables by these names."""
    solutions = read_samples(solutions_csv)
    check_columns(solutions_csv, solutions, (*CHOSEN, *targets.predicted))
    solutions["solution"] = solutions["solution"].astype(str)
    jobs = read_jobs(job_json_paths, solutions, targets)
    tables = validate(solutions, jobs, targets, _published(published_csv), support)
    for name, table in tables.items():
        write_table(Path(out_dir) / f"{name}.csv", table)
    return tables


def write_published_solutions(
    published_csv: str | os.PathLike, names: Sequence[str], out_csv: str | os.PathLike
) -> pd.DataFrame:
    """Write the published parameter sets to simulate, numbered as in `solutions_to_simulate`; return the table."""
    published = read_table(published_csv, ("solution", *names))
    numbers = range(FIRST_PUBLISHED, FIRST_PUBLISHED + len(published))
    table = pd.DataFrame({"sample": numbers, **{name: published[name] for name in names}})
    write_table(out_csv, table)
    return table


def _published(path):
    """The published solutions; None if there are none."""
    return None if path is None else read_table(path, ("solution", *PARAMETERS))
