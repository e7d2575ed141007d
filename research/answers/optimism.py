"""Whether the expected optimism that a study prints is the error of its predictions.

    python -m research.answers.optimism simulate --first 0 --last 36 --out optimism.csv
    python -m research.answers.optimism kept --out optimism_kept.csv
    python -m research.answers.optimism summary --tables optimism.csv

`simulate`: data sets of the default's size (150 samples, 6 pours) from the process of `kept_truth.py` are fitted and
searched as a study does it. The error of a prediction is prediction less truth; the corrected prediction has the
expected optimism of `repose.calibrate.optimism` taken off. Fits have 8 starts in place of 20, searches 20 rounds in
place of 870, and the optimism 10 replicates in place of the default's, so that a data set takes a quarter of a minute.

`kept`: the same at the answers of `results/published/goji_berry` that were simulated again.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from repose.calibrate.inversion import invert
from repose.calibrate.optimism import ReplicateRuns, estimate_optimism
from repose.calibrate.surrogates import load
from repose.common.files import read_table, write_table
from repose.stages.validate import select_for_validation
from research.answers.kept_truth import DataSet, Truth, designed
from research.script import Script, option

STREAM = 111  # of random numbers, of this study alone
STARTS = 8
ROUNDS = 20
REPLICATES = 10

script = Script("answers.optimism", __doc__)


def searching(study, rounds):
    """A search of the whole ranges: the sets to simulate again, and their roles."""
    settings = study.settings.miga.model_copy(update={"rounds": rounds})
    names = list(study.parameters.names)

    def search(model):
        inversion = invert(model, study.parameters, study.targets, settings)
        count = study.settings.validation.solutions
        chosen = select_for_validation(inversion.solutions, count, study.parameters)
        return chosen[names].to_numpy(float), chosen["role"].tolist()

    return search


@script.part(
    "simulate",
    "optimism.csv",
    option("--first", type=int, default=0, help="number of the first data set (0)"),
    option("--last", type=int, default=36, help="number after the last (36)"),
)
def simulate(args, config):
    """Simulate data sets, and compare the errors of the predictions with the optimism."""
    study = args.study
    targets = study.targets
    truth = Truth.of_kept(study)
    X = designed(study)
    network = study.settings.network.model_copy(update={"starts": STARTS})
    search = searching(study, ROUNDS)
    rows = []
    if Path(args.out).exists():
        rows = pd.read_csv(args.out).to_dict("records")
    known = {row["data_set"] for row in rows}
    for number in range(args.first, args.last):
        if number in known:
            continue
        random = np.random.default_rng([STREAM, number])
        data = DataSet(X, list(truth.pour(X, study.settings.funnel.seeds, random)))
        seeded = network.model_copy(update={"seed": 2026 + number})
        model = data.fit(study, seeded)
        pours = ReplicateRuns.collect(model, *data.tables(study, targets), targets)
        optimism = estimate_optimism(
            model, pours, search, targets, replicates=REPLICATES, seed=number
        ).set_index(["role", "response"])
        sets, roles = search(model)
        error = model.predict(sets) - truth.mean(sets)
        for role in dict.fromkeys(roles):
            mean = error[[other == role for other in roles]].mean(axis=0)
            for name, value in zip(targets.names, mean, strict=True):
                row = {"data_set": number, "role": role, "response": name}
                expected = optimism.loc[(role, name)]
                row |= {"error": value, "optimism": expected["optimism"]}
                rows.append(row | {"optimism_se": expected["optimism_se"]})
        write_table(args.out, pd.DataFrame(rows), float_format="%.6g")
    return summarised(pd.DataFrame(rows)).to_string(index=False)


def summarised(table):
    """Mean and standard error over the data sets: error, optimism, corrected error."""
    rows = []
    table = table.assign(corrected=table["error"] - table["optimism"])
    for (role, response), group in table.groupby(["role", "response"], sort=False):
        row = {"role": role, "response": response, "data_sets": len(group)}
        for name in ("error", "optimism", "corrected"):
            row[name] = group[name].mean()
            row[f"{name}_se"] = group[name].sem()
        rows.append(row)
    return pd.DataFrame(rows)


@script.part(
    "summary",
    "optimism_summary.csv",
    option("--tables", nargs="+", required=True, help="tables of `simulate`"),
)
def summary(args, config):
    """Summarise tables of `simulate`."""
    needed = ("data_set", "role", "response", "error", "optimism")
    table = summarised(pd.concat([read_table(path, needed) for path in args.tables]))
    write_table(args.out, table, float_format="%.4g")
    return table.to_string(index=False)


@script.part("kept", "optimism_kept.csv")
def kept(args, config):
    """Compare the predictions of the published run with its pours."""
    study = args.study
    targets = study.targets
    folder = Path("results/published/goji_berry")
    model = load(folder / "network/network.json")
    dataset = pd.read_csv(folder / "dataset.csv")
    runs = pd.read_csv(folder / "runs.csv")
    pours = ReplicateRuns.collect(model, dataset, runs, targets)
    optimism = estimate_optimism(
        model,
        pours,
        searching(study, ROUNDS),
        targets,
        replicates=2 * REPLICATES,
        seed=study.settings.miga.seed,
    ).set_index(["role", "response"])
    table4 = pd.read_csv(folder / "validation/table4.csv")
    rows = []
    for _, row in table4.iterrows():
        for response in targets.responses:
            expected = optimism.loc[(row["role"], response.name)]
            error = row[response.predicted] - row[response.simulated]
            corrected = error - expected["optimism"]
            corrected_se = np.hypot(
                row[response.standard_error], expected["optimism_se"]
            )
            rows.append(
                {
                    "solution": row["solution"],
                    "role": row["role"],
                    "pours": row["n_seeds"],
                    "response": response.name,
                    "predicted": row[response.predicted],
                    "simulated": row[response.simulated],
                    "simulated_se": row[response.standard_error],
                    "error": error,
                    "optimism": expected["optimism"],
                    "corrected": corrected,
                    "corrected_se": corrected_se,
                }
            )
    table = pd.DataFrame(rows)
    write_table(args.out, table, float_format="%.4g")
    return table.to_string(index=False)


if __name__ == "__main__":
    script.run()
