"""Calibrated solutions simulated again: Table 4, the physical pile, the published solutions in this engine.

Section 4.2.1 of the paper. `write_solutions` says what is to be simulated, `run` puts prediction, simulation
and the physical pile side by side. Errors are relative, as in Table 4: |predicted - simulated| / simulated,
and for the representative solution |simulated - physical| / physical, in percent.
"""

from pathlib import Path

import pandas as pd

from repose.chain.dataset import read_jobs, read_samples
from repose.core.errors import InputError
from repose.core.files import read_table
from repose.core.parameters import PARAMETERS
from repose.core.runs import summarise_runs
from repose.measure.angles import RECORDED
from repose.search.miga import select_for_validation

PREDICTED = ("aor_predicted_deg", "height_predicted_mm")
SIMULATED = ("aor_simulated_deg", "height_simulated_mm")
SOLUTION_COLUMNS = ("sample", *PARAMETERS, "origin", "solution", "role", *PREDICTED)
FIRST_PUBLISHED = 101  # sample numbers of ours run from 1, so the two can never meet


def write_solutions(feasible_csv, published_table4_csv, ranges, count, out_csv):
    """Write what is to be simulated, as samples.csv with more columns behind it; return the table.

    Ours are samples 1 to count + 1, the representative first (`repose.search.miga.select_for_validation`); the
    published ones follow from 101 in the order of their table. origin: "miga" or "published"; solution: its
    name in its own table; role: "representative" or "spread". Predictions are of the network that belongs to
    the solution, so the published network's for the published. Raises InputError for a bad file or too few
    solutions.
    """
    feasible = read_table(feasible_csv, ("solution", *PARAMETERS, *PREDICTED, "feasible", "representative"))
    if len(feasible) < count + 1:
        raise InputError(feasible_csv, "solutions", len(feasible), f"at least {count + 1}")
    ours = select_for_validation(feasible, count, ranges)
    ours["origin"], ours["sample"] = "miga", range(1, len(ours) + 1)
    theirs = read_table(published_table4_csv, ("solution", *PARAMETERS, *PREDICTED))
    theirs["origin"] = "published"
    theirs["sample"] = range(FIRST_PUBLISHED, FIRST_PUBLISHED + len(theirs))
    named = theirs["solution"].astype(str) == "representative"
    theirs["role"] = named.map({True: "representative", False: "spread"})
    columns = list(SOLUTION_COLUMNS)
    both = pd.concat([ours[columns].astype({"solution": str}), theirs[columns].astype({"solution": str})])
    Path(out_csv).parent.mkdir(parents=True, exist_ok=True)
    both.to_csv(out_csv, index=False)
    return both.reset_index(drop=True)


def run(solutions_csv, heap_json_paths, published_table4_csv, target, out_dir, support=None):
    """Write table4.csv, representative.csv and published.csv into out_dir; return the three tables.

    solutions_csv: of `write_solutions`. heap_json_paths: one heap job for each of its samples. target:
    physical_aor_deg, physical_aor_sd_deg, physical_height_mm, physical_height_sd_mm. A solution whose
    simulation failed keeps its row, with its status and no numbers. support: `repose.surrogate.support.Support` of the
    samples; with it the column `warning` of table4.csv and published.csv says which solutions lie beyond them.
    Raises InputError for a missing or bad file.
    """
    solutions = read_samples(solutions_csv)
    for column in SOLUTION_COLUMNS:
        if column not in solutions:
            raise InputError(solutions_csv, column, None, f"columns {', '.join(SOLUTION_COLUMNS)}")
    solutions["solution"] = solutions["solution"].astype(str)
    jobs = read_jobs(heap_json_paths, solutions)
    simulated = pd.DataFrame(
        [summarise_runs(jobs[sample]["runs"], RECORDED) for sample in solutions["sample"]]
    )
    simulated = simulated.rename(columns={"aor_deg": SIMULATED[0], "height_mm": SIMULATED[1]})
    numbers = [*SIMULATED, "aor_se_deg", "height_se_mm"]
    simulated[numbers] = simulated[numbers].astype(float)  # None of a failed solution, or of one seed, to NaN
    rows = pd.concat([solutions, simulated], axis=1)

    ours = rows[rows["origin"] == "miga"]
    tables = {
        "table4": table4(ours),
        "representative": against_physical(ours[ours["role"] == "representative"].iloc[0], target),
        "published": beside_published(rows[rows["origin"] == "published"], published_table4_csv),
    }
    if support is not None:
        for name in ("table4", "published"):
            tables[name]["warning"] = support.warnings(tables[name][list(PARAMETERS)])
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    for name, table in tables.items():
        table.to_csv(out / f"{name}.csv", index=False)
    return tables


def table4(rows):
    """Table 4: predicted, simulated with its standard error, and relative error (%) of each solution."""
    table = rows[["sample", "solution", "role", *PARAMETERS]].copy()
    for response, unit in (("aor", "deg"), ("height", "mm")):
        predicted, simulated = rows[f"{response}_predicted_{unit}"], rows[f"{response}_simulated_{unit}"]
        table[f"{response}_predicted_{unit}"] = predicted
        table[f"{response}_simulated_{unit}"] = simulated
        table[f"{response}_se_{unit}"] = rows[f"{response}_se_{unit}"]
        table[f"{response}_error_percent"] = 100 * (predicted - simulated).abs() / simulated
    for column in ("n_seeds", "status", "reason"):
        table[column] = rows[column]
    return table


def against_physical(row, target):
    """The representative solution's simulation against the physical pile, one row a response."""
    rows = []
    for response, unit in (("aor", "deg"), ("height", "mm")):
        mean, sd = target[f"physical_{response}_{unit}"], target[f"physical_{response}_sd_{unit}"]
        simulated = row[f"{response}_simulated_{unit}"]
        rows.append(
            {
                "response": f"{response}_{unit}",
                "physical_mean": mean,
                "physical_sd": sd,
                "predicted": row[f"{response}_predicted_{unit}"],
                "simulated": simulated,
                "simulated_se": row[f"{response}_se_{unit}"],
                "error_percent": 100 * abs(simulated - mean) / mean,
                "within_one_sd": bool(abs(simulated - mean) <= sd),
                "n_seeds": row["n_seeds"],
                "status": row["status"],
            }
        )
    return pd.DataFrame(rows)


def beside_published(rows, published_table4_csv):
    """The published solutions: their simulation beside ours with its standard error, and ours minus
    theirs."""
    published = read_table(published_table4_csv, ("solution", *SIMULATED))
    published["solution"] = published["solution"].astype(str)
    theirs = published.set_index("solution").reindex(rows["solution"])
    table = rows[["sample", "solution", *PARAMETERS]].copy()
    for response, unit in (("aor", "deg"), ("height", "mm")):
        simulated = f"{response}_simulated_{unit}"
        table[f"{response}_published_predicted_{unit}"] = rows[f"{response}_predicted_{unit}"]
        table[f"{response}_published_simulated_{unit}"] = theirs[simulated].to_numpy(float)
        table[simulated] = rows[simulated]
        table[f"{response}_se_{unit}"] = rows[f"{response}_se_{unit}"]
        table[f"{response}_difference_{unit}"] = rows[simulated] - theirs[simulated].to_numpy(float)
    for column in ("n_seeds", "status", "reason"):
        table[column] = rows[column]
    return table
