"""Rounds of the refinement: their jobs, how a round is judged, and whether another one follows.

Samples of round k are numbered from 1000 (k + 1). The proposal's seeds are cut into jobs from 1 on, each a sample of
its own; the neighbours follow from 101.

A round is judged by the simulated means of its proposal alone, from fresh seeds. It is within the bar when every mean
is within ``refine.tolerance_percent`` of its target, with a standard error below ``refine.standard_error_percent`` of
the target.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from repose.calibrate.responses import derived
from repose.calibrate.runs import Recorded, of_bench, summarise_runs
from repose.calibrate.search.objective import Objective
from repose.calibrate.strategies.refined import RefineSettings
from repose.calibrate.study import Study
from repose.calibrate.targets import Target, Targets

OF_A_ROUND, FIRST_NEIGHBOUR = 1000, 101
PROPOSAL, NEIGHBOUR = "proposal", "neighbour"
Verdict = Mapping[str, Any]  # a row of `judge`


def jobs(section: RefineSettings, round_: int) -> list[tuple[int, str, int]]:
    """List the jobs (sample, role, seeds) of a round: the proposal in blocks of seeds, then the neighbours.

    A block is one job, so that all cores work and a kill costs one block.
    """
    first, block = OF_A_ROUND * (round_ + 1), section.block
    counts = [
        min(block, section.seeds - start) for start in range(0, section.seeds, block)
    ]
    proposed = [(first + 1 + k, PROPOSAL, count) for k, count in enumerate(counts)]
    numbers = range(
        first + FIRST_NEIGHBOUR, first + FIRST_NEIGHBOUR + section.neighbours
    )
    return proposed + [
        (number, NEIGHBOUR, section.neighbour_seeds) for number in numbers
    ]


def round_of(sample: int) -> int:
    """Return the round to which a sample number belongs; -1 for a sample of the design."""
    return sample // OF_A_ROUND - 1


def goes_on(verdict: Verdict, before: Verdict | None = None) -> bool:
    """Decide whether another round has something to gain: the bar is missed and there are new data to learn from.

    Where the targets are out of reach, the loop goes on as long as it comes nearer than the round `before`.
    """
    return (
        verdict["outcome"] != "within"
        and verdict["usable"] > 0
        and not stuck(verdict, before)
    )


def stuck(verdict: Verdict, before: Verdict | None) -> bool:
    """Decide whether a round with targets out of reach came no nearer than the round before."""
    return (
        before is not None
        and verdict["out_of_reach"]
        and verdict["objective"] >= before["objective"]
    )


def judge(
    proposal: pd.DataFrame, runs: pd.DataFrame, study: Study, round_: int
) -> dict[str, Any]:
    """Judge a round: return a row of batches.csv, with NaN for a missing number.

    `objective` is Eq. 11 of the simulated means; `out_of_reach`: the prediction itself misses the bar.
    """
    targets, section = study.targets, study.settings.refine
    rows = proposal[proposal["role"] == PROPOSAL]
    own, first = runs[runs["sample"].isin(rows["sample"])], rows.iloc[0]
    summary = _summary(own, targets)
    row: dict[str, Any] = {
        "round": round_,
        **{name: float(first[name]) for name in study.parameters.names},
    }
    row |= {"poured": len(own), "n_seeds": summary["n_seeds"]}
    for target in targets:
        row |= _numbers(target, float(first[target.response.predicted]), summary)
    row["objective"] = _objective(summary, targets)
    off = abs(first[list(targets.predicted)].to_numpy(float) - targets.aim)
    row["out_of_reach"] = bool(
        (100 * off > section.tolerance_percent * targets.whole).any()
    )
    row["outcome"], row["reason"] = _outcome(row, summary, study)
    row["warning"] = "" if pd.isna(first["warning"]) else str(first["warning"])
    return row


def objective_of(
    jobs_of_round: Sequence[tuple[int, str, int]], runs: pd.DataFrame, targets: Targets
) -> float:
    """Compute the `objective` of a round with these `jobs`."""
    proposed = [sample for sample, role, _ in jobs_of_round if role == PROPOSAL]
    return _objective(_summary(runs[runs["sample"].isin(proposed)], targets), targets)


def _objective(summary: Mapping[str, Any], targets: Targets) -> float:
    """Compute Eq. 11 for the means of a summary."""
    return float(
        Objective(targets)(np.array([[summary[name] for name in targets.names]]))[0][0]
    )


def _summary(runs: pd.DataFrame, targets: Targets) -> dict[str, Any]:
    """Compute means and errors of all runs of a proposal; its status is ok where it is in every bench test."""
    runs = runs.astype(object).where(runs.notna(), None)
    summary: dict[str, Any] = {}
    for bench, own in targets.benches.items():
        names = tuple(targets.names[k] for k in own)
        measured = summarise_runs(
            of_bench(runs, bench).to_dict("records"), Recorded(names)
        )
        seeds = min(measured["n_seeds"], summary.get("n_seeds", measured["n_seeds"]))
        failed = (
            summary.get("status", "ok") != "ok"
        )  # the status of the first bench test that failed stays
        summary = (measured | summary if failed else summary | measured) | {
            "n_seeds": seeds
        }
    return {key: np.nan if value is None else value for key, value in summary.items()}


def _numbers(
    target: Target, predicted: float, summary: Mapping[str, Any]
) -> dict[str, float]:
    """Make the columns of one response in a round's row."""
    response, wanted, quantity = target.response, target.aim, target.response.quantity
    mean, error = summary[target.name], summary[response.error]
    return {
        derived(response.name, "target"): wanted,
        response.predicted: predicted,
        response.simulated: mean,
        response.error: error,
        f"{quantity}_deviation_percent": 100 * (mean - wanted) / wanted,
        f"{quantity}_se_percent": 100 * error / wanted,
        f"{quantity}_deviation_se": (mean - wanted) / error if error > 0 else np.nan,
        f"{quantity}_prediction_error_percent": 100 * (predicted - mean) / mean,
    }


def _outcome(
    row: Mapping[str, Any], summary: Mapping[str, Any], study: Study
) -> tuple[str, str]:
    """Find the outcome of a round, and say in words how far each response is off."""
    if summary["status"] != "ok":
        return "no pile", f"{summary['status']}: {summary['reason']}"
    section, words, far, vague = study.settings.refine, [], False, False
    for target in study.targets:
        response, unit = target.response, target.response.unit
        off, error = (
            row[f"{response.quantity}_deviation_percent"],
            row[f"{response.quantity}_se_percent"],
        )
        counted, misses = (
            row[f"{response.quantity}_deviation_se"],
            abs(off) > section.tolerance_percent,
        )
        text = f"{response.symbol} {row[response.simulated]:.2f} {unit} is {abs(off):.2f} %"
        text += f" ({abs(counted):.1f} standard errors)" if np.isfinite(counted) else ""
        text += f" {'above' if off > 0 else 'below'} {target.aim:g} {unit}"
        text += "" if misses else f", within {section.tolerance_percent:g} %"
        far |= misses
        if not error < section.standard_error_percent:
            vague = True
            known = f"is {error:.2f} %" if np.isfinite(error) else "is not known"
            text += f", its standard error {known}, not below {section.standard_error_percent:g} %"
        words.append(text)
    outcome = "not within" if far else "not precise" if vague else "within"
    return outcome, "" if outcome == "within" else "; ".join(words)


def why_stopped(
    verdict: Verdict, limit: int, targets: Targets, before: Verdict | None = None
) -> str:
    """Say why the loop ends after a round.

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


def claim(verdict: Verdict, targets: Targets) -> str:
    """Say what is claimed for the proposal of the last round, from the round's own runs."""
    if verdict["outcome"] == "no pile":
        return "none: the proposal gives no pile"
    values = []
    for response in targets.responses:
        error, off = (
            verdict[response.error],
            verdict[f"{response.quantity}_deviation_percent"],
        )
        known = f"{error:.2f}" if np.isfinite(error) else "unknown"
        mean = f"{response.symbol} {verdict[response.simulated]:.2f} ± {known}"
        values.append(f"{mean} {response.unit} ({off:+.2f} %)")
    seeds = f"{verdict['n_seeds']} fresh seeds, in no fit before"
    return f"{' and '.join(values)}, mean and standard error of {seeds}"
