"""Rounds of the refinement: their jobs, how a round is judged, and whether another one follows.

Samples of round k are numbered from 1000 (k + 1). The proposal's seeds are cut into jobs from 1 on, each a sample of
its own; the neighbours follow from 101.

A round is judged by the simulated means of its proposal alone, from fresh seeds. It is within the bar when every mean
is within ``refine.tolerance_percent`` of its target, with a standard error below ``refine.standard_error_percent`` of
the target.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from repose.chain.answer import describe_parameters
from repose.core.errors import InputError
from repose.core.files import read_json, read_table, write_json, write_table
from repose.core.parameter_sets import read_samples
from repose.core.parameters import named
from repose.core.responses import Response, derived
from repose.core.runs import Recorded, of_bench, summarise_runs
from repose.core.targets import Targets
from repose.search.objective import Objective

OF_A_ROUND, FIRST_NEIGHBOUR = 1000, 101
PROPOSAL, NEIGHBOUR = "proposal", "neighbour"
OUTCOMES = ("within", "not within", "not precise", "no pile")


def jobs(section: Mapping[str, Any], round_: int) -> list[tuple[int, str, int]]:
    """Jobs (sample, role, seeds) of a round: the proposal in blocks of seeds, then the neighbours.

    A block is one job, so that all cores work and a kill costs one block.
    """
    first, block = OF_A_ROUND * (round_ + 1), section["block"]
    counts = [min(block, section["seeds"] - start) for start in range(0, section["seeds"], block)]
    proposed = [(first + 1 + k, PROPOSAL, count) for k, count in enumerate(counts)]
    numbers = range(first + FIRST_NEIGHBOUR, first + FIRST_NEIGHBOUR + section["neighbours"])
    return proposed + [(number, NEIGHBOUR, section["neighbour_seeds"]) for number in numbers]


def round_of(sample: int) -> int:
    """Round to which a sample number belongs; -1 for a sample of the design."""
    return sample // OF_A_ROUND - 1


def goes_on(verdict: Mapping[str, Any], before: Mapping[str, Any] | None = None) -> bool:
    """Whether another round has something to gain: the bar is missed and there are new data to learn from.

    Where the targets are out of reach, the loop goes on as long as it comes nearer than the round `before`.
    """
    return verdict["outcome"] != "within" and verdict["usable"] > 0 and not stuck(verdict, before)


def stuck(verdict: Mapping[str, Any], before: Mapping[str, Any] | None) -> bool:
    """Whether a round with targets out of reach came no nearer than the round before."""
    if before is None or not verdict["out_of_reach"] or None in (verdict["objective"], before["objective"]):
        return False
    return verdict["objective"] >= before["objective"]


def judge(
    proposal: pd.DataFrame,
    runs: pd.DataFrame,
    targets: Targets,
    section: Mapping[str, Any],
    round_: int,
    names: Sequence[str],
) -> dict[str, Any]:
    """Result of a round, a row of rounds.csv: a missing number is NaN, `outcome` is of `OUTCOMES`.

    `objective` is Eq. 11 of the simulated means; `out_of_reach`: the prediction itself misses the bar.
    """
    rows = proposal[proposal["role"] == PROPOSAL]
    own = runs[runs["sample"].isin(rows["sample"])]
    summary = _summary(own, targets)
    row: dict[str, Any] = {"round": round_, **{name: float(rows[name].iloc[0]) for name in names}}
    row |= {"poured": len(own), "n_seeds": summary["n_seeds"]}
    for target in targets:
        predicted = float(rows[target.response.predicted].iloc[0])
        mean, error = (_number(summary[key]) for key in (target.name, target.response.error))
        row |= _numbers(target.response, target.aim, predicted, mean, error)
    row["objective"] = _objective(summary, targets)
    off = abs(np.array([row[key] for key in targets.predicted]) - targets.aim)
    row["out_of_reach"] = bool((100 * off > section["tolerance_percent"] * targets.whole).any())
    row["outcome"], row["reason"] = _outcome(row, summary, targets, section)
    row["warning"] = str(rows["warning"].iloc[0]) if pd.notna(rows["warning"].iloc[0]) else ""
    return row


def objective_of(
    jobs_of_round: Sequence[tuple[int, str, int]], runs: pd.DataFrame, targets: Targets
) -> float:
    """`objective` of a round with these `jobs`."""
    proposed = [sample for sample, role, _ in jobs_of_round if role == PROPOSAL]
    return _objective(_summary(runs[runs["sample"].isin(proposed)], targets), targets)


def _objective(summary: Mapping[str, Any], targets: Targets) -> float:
    """Eq. 11 of the means of a summary."""
    means = np.array([[_number(summary[name]) for name in targets.names]])
    return float(Objective.of(targets)(means)[0][0])


def _summary(runs: pd.DataFrame, targets: Targets) -> dict[str, Any]:
    """Means and errors of all runs of a proposal; it is ok where it is in every bench test."""
    runs = runs.astype(object).where(runs.notna(), None)
    summary: dict[str, Any] = {}
    for bench in targets.apparatus:
        names = tuple(target.name for target in targets if target.response.apparatus == bench)
        measured = summarise_runs(of_bench(runs, bench).to_dict("records"), Recorded(names))
        seeds = min(measured["n_seeds"], summary.get("n_seeds", measured["n_seeds"]))
        failed = summary.get("status", "ok") != "ok"  # the status of the first bench test that failed stays
        summary = (measured | summary if failed else summary | measured) | {"n_seeds": seeds}
    return summary


def _numbers(
    response: Response, wanted: float, predicted: float, mean: float, error: float
) -> dict[str, float]:
    """Columns of one response in rounds.csv."""
    name, quantity = response.name, response.quantity
    return {
        derived(name, "target"): wanted,
        response.predicted: predicted,
        response.simulated: mean,
        response.error: error,
        f"{quantity}_deviation_percent": 100 * (mean - wanted) / wanted,
        f"{quantity}_se_percent": 100 * error / wanted,
        f"{quantity}_deviation_se": (mean - wanted) / error if error > 0 else np.nan,
        f"{quantity}_prediction_error_percent": 100 * (predicted - mean) / mean,
    }


def _number(value: float | None) -> float:
    """A number, NaN for None."""
    return np.nan if value is None else float(value)


def _outcome(
    row: Mapping[str, Any], summary: Mapping[str, Any], targets: Targets, section: Mapping[str, Any]
) -> tuple[str, str]:
    """Outcome of a round, and the deviation of each response in words."""
    if summary["status"] != "ok":
        return "no pile", f"{summary['status']}: {summary['reason']}"
    words, far, vague = [], False, False
    for target in targets:
        response, unit = target.response, target.response.unit
        off, error = row[f"{response.quantity}_deviation_percent"], row[f"{response.quantity}_se_percent"]
        counted, misses = row[f"{response.quantity}_deviation_se"], abs(off) > section["tolerance_percent"]
        text = f"{response.symbol} {row[response.simulated]:.2f} {unit} is {abs(off):.2f} %"
        text += f" ({abs(counted):.1f} standard errors)" if np.isfinite(counted) else ""
        text += f" {'above' if off > 0 else 'below'} {target.aim:g} {unit}"
        text += "" if misses else f", within {section['tolerance_percent']:g} %"
        far |= misses
        if not error < section["standard_error_percent"]:
            vague = True
            known = f"is {error:.2f} %" if np.isfinite(error) else "is not known"
            text += f", its standard error {known}, not below {section['standard_error_percent']:g} %"
        words.append(text)
    outcome = "not within" if far else "not precise" if vague else "within"
    return outcome, "" if outcome == "within" else "; ".join(words)


def why_stopped(
    verdict: Mapping[str, Any], limit: int, targets: Targets, before: Mapping[str, Any] | None = None
) -> str:
    """Why the loop ends after a round, in words.

    `verdict` is of the last round, `before` of the round before it; `limit` is the largest number of refits.
    """
    row = f"round {verdict['round']}"
    if verdict["outcome"] == "within":
        return f"{row} meets {('the target', 'both targets', 'all targets')[min(len(targets), 3) - 1]}"
    if stuck(verdict, before):
        return f"{row} predicts that the targets are out of reach and came no nearer: {verdict['reason']}"
    if not goes_on(verdict):
        return f"{row} gave no pile to learn from ({verdict['reason']})"
    return f"the limit of {limit} refits is reached, and {row} is {verdict['outcome']}: {verdict['reason']}"


def claim(verdict: Mapping[str, Any], targets: Targets) -> str:
    """Claim for the proposal of the last round in words, from the round's own runs."""
    if verdict["outcome"] == "no pile":
        return "none: the proposal gives no pile"
    values = []
    for response in targets.responses:
        error, off = verdict[response.error], verdict[f"{response.quantity}_deviation_percent"]
        known = "unknown" if error is None else f"{error:.2f}"
        mean = f"{response.symbol} {verdict[response.simulated]:.2f} ± {known}"
        values.append(f"{mean} {response.unit} ({off:+.2f} %)")
    seeds = f"{verdict['n_seeds']} fresh seeds, in no fit before"
    return f"{' and '.join(values)}, mean and standard error of {seeds}"


def points(
    proposal: pd.DataFrame, dataset: pd.DataFrame, row: Mapping[str, Any], targets: Targets
) -> pd.DataFrame:
    """The table round.csv: all points of a round, the jobs of the proposal as a single point (`row` of `judge`)."""
    measured = [column for target in targets for column in (target.name, target.response.error)]
    shown = dataset[["sample", "n_seeds", *targets.names, *targets.errors, "status", "reason"]]
    table = proposal.drop(columns=["seeds", "warning"]).merge(shown, on="sample")
    renamed = {target.name: target.response.simulated for target in targets}
    table = table.rename(columns=renamed)
    own = table["role"] == PROPOSAL
    table = pd.concat([table[own].head(1), table[~own]], ignore_index=True).astype({"reason": object})
    for column in ("n_seeds", *(renamed.get(name, name) for name in measured)):
        table.loc[0, column] = row[column]
    if row["outcome"] != "no pile":
        table.loc[0, ["status", "reason"]] = ["ok", ""]
    return table


def run_judge(
    proposal_csv: str | os.PathLike,
    dataset_csv: str | os.PathLike,
    runs_csv: str | os.PathLike,
    targets: Targets,
    section: Mapping[str, Any],
    out_dir: str | os.PathLike,
) -> dict[str, Any]:
    """Write round.csv (`points`) and verdict.json, the row of `judge` with the number of usable samples; return it."""
    proposal = read_samples(proposal_csv)
    dataset = read_table(dataset_csv, ("sample", "status", "n_seeds", *targets.names, *targets.errors))
    runs = read_table(runs_csv, ("sample", "status", "reason", *targets.names))
    missing = sorted(set(proposal["sample"]) - set(dataset["sample"]))
    if missing:
        raise InputError(dataset_csv, "samples", missing, f"all samples of {proposal_csv}")
    round_ = round_of(int(proposal["sample"].iloc[0]))
    row = judge(proposal, runs, targets, section, round_, named(proposal))
    row |= {"usable": int((dataset["status"] == "ok").sum())}
    write_table(Path(out_dir) / "round.csv", points(proposal, dataset, row, targets))
    write_json(Path(out_dir) / "verdict.json", _plain(row))
    return row


def run_tables(
    verdict_jsons: Sequence[str | os.PathLike], limit: int, targets: Targets, out_dir: str | os.PathLike
) -> dict[str, Any]:
    """Write rounds.csv, a row for each round, and summary.json with the reason of the stop; return the summary.

    InputError if the rounds, in any order, are not 0, 1, 2, ...
    """
    keys = {"round": int, "outcome": str}
    verdicts = [read_json(path, keys, "output of repose stage refine_judge") for path in verdict_jsons]
    verdicts.sort(key=lambda verdict: verdict["round"])
    if [verdict["round"] for verdict in verdicts] != list(range(len(verdicts))) or not verdicts:
        raise InputError(
            "verdicts", "rounds", [verdict["round"] for verdict in verdicts], "0, 1, 2, ... without a gap"
        )
    write_table(Path(out_dir) / "rounds.csv", pd.DataFrame(verdicts))
    last = verdicts[-1]
    summary = {
        "met": last["outcome"] == "within",
        "rounds": len(verdicts),
        "why": why_stopped(last, limit, targets, verdicts[-2] if len(verdicts) > 1 else None),
        "solution": {name: last[name] for name in named(last)},
        "claim": claim(last, targets),
        "pours": int(sum(verdict["poured"] for verdict in verdicts)),
    }
    write_json(Path(out_dir) / "summary.json", summary)
    return summary


def describe(summary_json: str | os.PathLike, label: str) -> str:
    """Result of a finished refinement for the end of a run; `summary_json` is of `run_tables`."""
    keys = {"met": bool, "why": str, "solution": dict, "claim": str, "pours": int}
    summary = read_json(summary_json, keys, "output of repose stage refine_tables")
    met = "Refined: targets met" if summary["met"] else "Refined: targets NOT met"
    return "\n".join(
        [
            f"{label}: the refined parameters:",
            *describe_parameters(summary["solution"]),
            f"Simulated: {summary['claim']}",
            f"Tables: {Path(summary_json).parent}; pours of all rounds: {summary['pours']}",
            f"{met}; {summary['why']}.",
        ]
    )


def _plain(row: Mapping[str, Any]) -> dict[str, Any]:
    """The row for JSON, which has no NaN: None instead."""
    return {
        key: None if isinstance(value, float) and np.isnan(value) else value for key, value in row.items()
    }
