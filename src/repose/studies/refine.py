"""The loop closed: the search's answer is simulated, added to the data, the network refitted, the search run again.

Round 0 simulates what the main chain proposes. Every round pours its proposal with many fresh seeds and a few
neighbours with fewer, and is judged by the simulated mean of the proposal alone. As long as that misses the target,
all points so far join the training samples, the refitted network is set right near the last proposal, and the search
runs again there. docs/refinement.md says why each of these steps is needed.

Samples of round k are numbered from 1000 (k + 1): the proposal's pours are cut into jobs from 1 on, each a sample of
its own, the neighbours follow from 101.
"""

import json
from pathlib import Path

import numpy as np
import pandas as pd

from repose.chain.dataset import read_samples
from repose.core.errors import InputError
from repose.core.files import read_table, write_json, write_table
from repose.core.parameters import PARAMETERS
from repose.core.runs import summarise_runs
from repose.core.seeds import PURPOSES
from repose.core.targets import section_of
from repose.measure.angles import RECORDED
from repose.search import miga
from repose.surrogate.bayesian_bp import RESPONSES, evaluate, load

OF_A_ROUND, FIRST_NEIGHBOUR = 1000, 101
PREDICTED = ("aor_predicted_deg", "height_predicted_mm")
NAMES = (("aor", "deg", "AoR"), ("height", "mm", "Height"))
PROPOSAL, NEIGHBOUR = "proposal", "neighbour"
OUTCOMES = ("within", "not within", "not precise", "no pile")
WIDENING = (0.125, 0.25, 0.5, 1.0)  # shares of the box, tried in this order
MET = 0.1  # a prediction this share of the tolerance from the target meets it
ROUNDING = 1e-9  # of a place in the box, in ranges


def jobs(section, round_):
    """Pours of a round as (sample, role, seeds): the proposal in blocks, then the neighbours.

    section: `refine` of the configuration. A block is one job, so that all cores work and a kill costs one block.
    """
    first, block = OF_A_ROUND * (round_ + 1), section["block"]
    counts = [min(block, section["seeds"] - start) for start in range(0, section["seeds"], block)]
    proposed = [(first + 1 + k, PROPOSAL, count) for k, count in enumerate(counts)]
    numbers = range(first + FIRST_NEIGHBOUR, first + FIRST_NEIGHBOUR + section["neighbours"])
    return proposed + [(number, NEIGHBOUR, section["neighbour_seeds"]) for number in numbers]


def round_of(sample):
    """Round to which a sample's number belongs; numbers of the design give -1."""
    return sample // OF_A_ROUND - 1


def search_box(ranges, centre, reach):
    """Ranges [low, high] of each parameter within `reach` of its range from centre, cut to the ranges.

    ranges: parameter to (low, high); centre: parameter to value.
    """
    box = {}
    for name in PARAMETERS:
        low, high = ranges[name]
        step = reach * (high - low)
        box[name] = [max(low, centre[name] - step), min(high, centre[name] + step)]
    return box


def propose(solutions, network, ranges, section, round_, study_seed):
    """What a round simulates: a table of sample, the six, role, seeds, both predictions and warning.

    solutions: feasible.csv of the search as a table, its representative is proposed. network: of `network.load`,
    for the predictions. Neighbours are a Latin hypercube in the box in which the next round searches.
    """
    # numba is slow to load, and a plan of the workflow needs `jobs` alone
    from repose.chain.design import lhsdesign

    best = solutions[solutions["representative"]].iloc[0]
    table = pd.DataFrame(jobs(section, round_), columns=["sample", "role", "seeds"])
    near = table["role"] == NEIGHBOUR
    for name in PARAMETERS:
        table[name] = float(best[name])
    if near.any():
        box = np.array([search_box(ranges, best, section["reach"])[name] for name in PARAMETERS])
        rng = np.random.default_rng([study_seed, PURPOSES["refine"], OF_A_ROUND * (round_ + 1)])
        unit = lhsdesign(int(near.sum()), len(PARAMETERS), rng=rng)
        table.loc[near, list(PARAMETERS)] = box[:, 0] + unit * (box[:, 1] - box[:, 0])
    table[list(PREDICTED)] = evaluate(network, table[list(PARAMETERS)].to_numpy(float))
    warning = best.get("warning", "")
    table["warning"] = np.where(near, "", "" if pd.isna(warning) else warning)
    return table[["sample", *PARAMETERS, "role", "seeds", *PREDICTED, "warning"]]


def extended(design, rounds):
    """The samples, or runs, of a design and of all rounds so far as one table with the column `round`.

    design: a table with the column sample; rounds: tables of the same columns whose samples are numbered by round.
    `round` is empty for the design's own rows; `repose.chain.train` has all others train. Raises ValueError for a
    sample that is there twice, or that is numbered like the design's.
    """
    added = pd.concat(rounds, ignore_index=True)
    added["round"] = round_of(added["sample"])
    if (added["round"] < 0).any() or design["sample"].max() >= OF_A_ROUND:
        raise ValueError(f"samples are numbered alike; allowed: below {OF_A_ROUND} in the design alone")
    owners = [set(table["sample"]) for table in rounds]
    if len(set().union(*owners)) < sum(map(len, owners)):
        raise ValueError("rounds hold a sample twice; allowed: each round once")
    return pd.concat([design, added], ignore_index=True).astype({"round": "Int64"})


def corrected(network, dataset, box):
    """The network with its output biases moved so that it meets the refined samples inside box on average.

    The refit follows the whole design and keeps a few percent of error where it matters; the mean of what is left
    at the refined samples inside the box, weighted by their seeds, is taken off. network: of `network.load`; dataset:
    of `extended`; box: parameter to (low, high). Returns the network, the offsets (2,) in deg and mm, and how many
    samples they are of. Raises ValueError where the box holds none.
    """
    low, high = np.array([box[name] for name in PARAMETERS], dtype=float).T
    added = dataset[dataset["round"].notna() & (dataset["status"] == "ok")]
    points = added[list(PARAMETERS)].to_numpy(float)
    slack = ROUNDING * (high - low)
    inside = ((points >= low - slack) & (points <= high + slack)).all(axis=1)
    if not inside.any():
        raise ValueError("no usable refined sample inside the box; allowed: at least one")
    left = added[list(RESPONSES)].to_numpy(float)[inside] - evaluate(network, points[inside])
    offset = np.average(left, axis=0, weights=added["n_seeds"].to_numpy(float)[inside])
    bottom, top = network["scaled_range"]
    width = np.subtract(network["output_max"], network["output_min"])
    bias = np.asarray(network["b2"]) + offset * (top - bottom) / width
    return network | {"b2": bias.tolist()}, offset, int(inside.sum())


def judge(proposal, runs, target, section, round_):
    """What a round has shown, as one row: predicted beside simulated, deviations, outcome and its reason.

    proposal: table of `propose`; runs: the round's runs.csv; target: aor_deg, height_mm. The bar, |simulated mean -
    target| at most tolerance_percent and a standard error below standard_error_percent, both of the target, is on
    the proposal's fresh pours alone. outcome: one of OUTCOMES.
    """
    rows = proposal[proposal["role"] == PROPOSAL]
    own = runs[runs["sample"].isin(rows["sample"])].astype(object)
    summary = summarise_runs(own.where(own.notna(), None).to_dict("records"), RECORDED)
    row = {"round": round_, **{name: float(rows[name].iloc[0]) for name in PARAMETERS}}
    row |= {"poured": len(own), "n_seeds": summary["n_seeds"]}
    for name, unit, _ in NAMES:
        wanted, predicted = target[f"{name}_{unit}"], float(rows[f"{name}_predicted_{unit}"].iloc[0])
        mean, error = (_number(summary[key]) for key in (f"{name}_{unit}", f"{name}_se_{unit}"))
        row |= {
            f"{name}_target_{unit}": wanted,
            f"{name}_predicted_{unit}": predicted,
            f"{name}_simulated_{unit}": mean,
            f"{name}_se_{unit}": error,
            f"{name}_deviation_percent": 100 * (mean - wanted) / wanted,
            f"{name}_se_percent": 100 * error / wanted,
            f"{name}_deviation_se": (mean - wanted) / error if error > 0 else np.nan,
            f"{name}_prediction_error_percent": 100 * (predicted - mean) / mean,
        }
    row["outcome"], row["reason"] = _outcome(row, summary, section)
    row["warning"] = str(rows["warning"].iloc[0]) if pd.notna(rows["warning"].iloc[0]) else ""
    return row


def _number(value):
    return np.nan if value is None else float(value)


def _outcome(row, summary, section):
    """Outcome of a round and what is to be said of it."""
    if summary["status"] != "ok":
        return "no pile", f"{summary['status']}: {summary['reason']}"
    words, far, vague = [], False, False
    for name, unit, label in NAMES:
        off, error = row[f"{name}_deviation_percent"], row[f"{name}_se_percent"]
        counted, misses = row[f"{name}_deviation_se"], abs(off) > section["tolerance_percent"]
        text = f"{label} {row[f'{name}_simulated_{unit}']:.2f} {unit} is {abs(off):.2f} %"
        text += f" ({abs(counted):.1f} standard errors)" if np.isfinite(counted) else ""
        text += f" {'above' if off > 0 else 'below'} {row[f'{name}_target_{unit}']:g} {unit}"
        text += "" if misses else f", within {section['tolerance_percent']:g} %"
        far |= misses
        if not error < section["standard_error_percent"]:
            vague = True
            known = f"is {error:.2f} %" if np.isfinite(error) else "is not known"
            text += f", its standard error {known}, not below {section['standard_error_percent']:g} %"
        words.append(text)
    outcome = "not within" if far else "not precise" if vague else "within"
    return outcome, "" if outcome == "within" else "; ".join(words)


def goes_on(verdict):
    """Whether another round has something to gain: the bar is missed and there are new data to learn from."""
    return verdict["outcome"] != "within" and verdict["usable"] > 0


def why_stopped(verdict, limit):
    """Why the loop ends after a round, in words. limit: how often the network may be refitted."""
    row = f"round {verdict['round']}"
    if verdict["outcome"] == "within":
        return f"{row} meets both targets"
    if not goes_on(verdict):
        return f"{row} gave no pile to learn from ({verdict['reason']})"
    return f"the limit of {limit} refits is reached, and {row} is {verdict['outcome']}: {verdict['reason']}"


# The workflow's stages


def write_proposal(feasible_csv, network_json, ranges, section, round_, study_seed, out_csv):
    """Write the table of `propose`; return it. Raises InputError for a bad file or a round that cannot be numbered."""
    if round_ < 0:
        raise InputError("command line", "--round", round_, "0 or more")
    feasible = read_table(feasible_csv, ("solution", *PARAMETERS, "representative"))
    if feasible["representative"].sum() != 1:
        raise InputError(
            feasible_csv, "representative", int(feasible["representative"].sum()), "one solution"
        )
    table = propose(feasible, load(network_json), ranges, section, round_, study_seed)
    write_table(out_csv, table)
    return table


def write_extended(dataset_csv, runs_csv, round_dirs, out_dir):
    """Write dataset.csv and runs.csv of the design and of all rounds in round_dirs; return them by name."""
    tables = {}
    for name, path in (("dataset", dataset_csv), ("runs", runs_csv)):
        files = [Path(folder) / f"{name}.csv" for folder in round_dirs]
        try:
            table = extended(read_table(path, ("sample",)), [read_table(file, ("sample",)) for file in files])
        except ValueError as error:
            raise InputError(
                path, "sample", str(error), "numbers as the verb refine_propose gives them"
            ) from None
        write_table(Path(out_dir) / f"{name}.csv", table)
        tables[name] = table
    return tables


def centre_of(proposal_csv):
    """Parameters of the proposal in a file of `write_proposal`, by name; or InputError."""
    table = read_table(proposal_csv, ("sample", *PARAMETERS, "role"))
    own = table[table["role"] == PROPOSAL]
    if own.empty:
        raise InputError(proposal_csv, "role", sorted(set(table["role"])), f"a {PROPOSAL}")
    return own.iloc[0][list(PARAMETERS)].astype(float).to_dict()


def search(network_json, dataset_csv, proposal_csv, config, table3_csv, out_dir):
    """Set the network right near the last proposal and search there; return the summary of the search.

    Writes the network of `corrected` and what `miga.run` writes, with `reach` and `offset` in its summary.
    The search begins in an eighth of the box of `refine.reach` and widens it until the target is met: of all
    parameter sets that would do, one near the last proposal is wanted, where the correction holds. dataset_csv: of
    `write_extended`; config: the whole configuration. Raises InputError.
    """
    from repose.surrogate.support import Support

    dataset = read_table(dataset_csv, ("sample", *PARAMETERS, "status", *RESPONSES, "n_seeds", "round"))
    ranges, target, reach = config["parameters"], section_of(config), config["refine"]["reach"]
    centre, out = centre_of(proposal_csv), Path(out_dir)
    try:
        network, offset, count = corrected(load(network_json), dataset, search_box(ranges, centre, reach))
    except ValueError as error:
        raise InputError(dataset_csv, "samples", str(error), "data of the last round") from None
    write_json(out / "network.json", network)
    support = Support.of_dataset(dataset_csv, ranges)
    for share in WIDENING:
        box = search_box(ranges, centre, share * reach)
        summary = miga.run(out / "network.json", box, target, config["miga"], table3_csv, out, support)
        off = [summary["target_distance"][key] / target[key] for key in RESPONSES]
        if max(off) < config["refine"]["tolerance_percent"] / 100 * MET:
            break
    summary |= {"reach": share * reach, "offset": dict(zip(RESPONSES, offset.tolist(), strict=True))}
    summary |= {"offset_samples": count}
    write_json(out / "summary.json", summary)
    return summary


def write_verdict(proposal_csv, dataset_csv, runs_csv, target, section, out_dir):
    """Judge a round: write round.csv and verdict.json; return the latter.

    round.csv: predicted beside simulated at all points of the round. dataset_csv, runs_csv: of the round's own jobs, as
    the verb dataset writes them. Raises InputError.
    """
    proposal = read_samples(proposal_csv)
    dataset = read_table(
        dataset_csv, ("sample", "status", "n_seeds", *RESPONSES, "aor_se_deg", "height_se_mm")
    )
    runs = read_table(runs_csv, ("sample", "status", "reason", *RESPONSES))
    missing = sorted(set(proposal["sample"]) - set(dataset["sample"]))
    if missing:
        raise InputError(dataset_csv, "samples", missing, f"all samples of {proposal_csv}")
    round_ = round_of(int(proposal["sample"].iloc[0]))
    row = judge(proposal, runs, target, section, round_) | {"usable": int((dataset["status"] == "ok").sum())}
    write_table(Path(out_dir) / "round.csv", points(proposal, dataset, row))
    write_json(Path(out_dir) / "verdict.json", _plain(row))
    return row


def points(proposal, dataset, row):
    """All points of a round, the proposal as one: parameters, seeds, predicted, simulated, standard errors, status."""
    table = proposal.drop(columns=["seeds", "warning"]).merge(
        dataset[["sample", "n_seeds", *RESPONSES, "aor_se_deg", "height_se_mm", "status", "reason"]],
        on="sample",
    )
    table = table.rename(columns={"aor_deg": "aor_simulated_deg", "height_mm": "height_simulated_mm"})
    own = table["role"] == PROPOSAL
    table = pd.concat([table[own].head(1), table[~own]], ignore_index=True).astype({"reason": object})
    pooled = ["n_seeds"] + [
        f"{name}_{what}_{unit}" for name, unit, _ in NAMES for what in ("simulated", "se")
    ]
    for column in pooled:
        table.loc[0, column] = row[column]
    if row["outcome"] != "no pile":
        table.loc[0, ["status", "reason"]] = ["ok", ""]
    return table


def write_tables(verdict_jsons, limit, out_dir):
    """Write rounds.csv, a row a round, and summary.json: why the loop stopped, what may be claimed. Return the latter.

    limit: how often the network may be refitted. Raises InputError for a bad file, or rounds that are not 0, 1, 2, ...
    """
    verdicts = []
    for path in verdict_jsons:
        try:
            verdicts.append(json.loads(Path(path).read_text()))
        except (OSError, ValueError) as error:
            raise InputError(path, "verdict", str(error), "what the verb refine_judge wrote") from error
    verdicts.sort(key=lambda one: one["round"])
    if [one["round"] for one in verdicts] != list(range(len(verdicts))) or not verdicts:
        raise InputError(
            "verdicts", "rounds", [one["round"] for one in verdicts], "0, 1, 2, ... without a gap"
        )
    write_table(Path(out_dir) / "rounds.csv", pd.DataFrame(verdicts))
    last = verdicts[-1]
    summary = {
        "met": last["outcome"] == "within",
        "rounds": len(verdicts),
        "why": why_stopped(last, limit),
        "solution": {name: last[name] for name in PARAMETERS},
        "claim": claim(last),
        "pours": int(sum(one["poured"] for one in verdicts)),
    }
    write_json(Path(out_dir) / "summary.json", summary)
    return summary


def claim(verdict):
    """What the last round's own pours say of its proposal."""
    if verdict["outcome"] == "no pile":
        return "none: the proposal gives no pile"
    values = [
        f"{label} {verdict[f'{name}_simulated_{unit}']:.2f} ± {_text(verdict[f'{name}_se_{unit}'])} {unit} "
        f"({verdict[f'{name}_deviation_percent']:+.2f} %)"
        for name, unit, label in NAMES
    ]
    seeds = f"{verdict['n_seeds']} seeds, which no fit had seen when they were poured"
    return f"{' and '.join(values)}, mean and standard error of {seeds}"


def _text(error):
    return "unknown" if error is None else f"{error:.2f}"


def _plain(row):
    """The row for JSON, which knows no NaN."""
    return {
        key: None if isinstance(value, float) and np.isnan(value) else value for key, value in row.items()
    }
