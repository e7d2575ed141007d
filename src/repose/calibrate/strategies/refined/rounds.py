"""Rounds of the refinement: their jobs, their verdicts, and whether another one follows.

Samples of round k are numbered from 1000 (k + 1). The seeds of the proposal are cut into
jobs from number 1 on, each a sample of its own; the neighbours follow from number 101.

A round is judged by the simulated means of its proposal alone, from fresh seeds. Its
outcome is "within" if every mean is within ``refine.tolerance_percent`` of its target, and
its standard error below ``refine.standard_error_percent`` of the target.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate.responses import derived
from repose.calibrate.runs import Recorded, of_bench, summarise_runs
from repose.calibrate.search.objective import Objective
from repose.calibrate.strategies.refined import RefineSettings
from repose.calibrate.study import Study
from repose.calibrate.targets import Target, Targets

# Numbers of samples: each round has a thousand, its neighbours begin at the second.
OF_A_ROUND = 1000
FIRST_NEIGHBOUR = 101
PROPOSAL = "proposal"
NEIGHBOUR = "neighbour"
# A row of batches.csv, as `judge` makes it.
Verdict = Mapping[str, Any]


class Job(NamedTuple):
    """Runs of one parameter set that are made in one go."""

    sample: int
    role: str  # PROPOSAL or NEIGHBOUR
    seeds: int  # number of runs


def jobs(section: RefineSettings, round_: int) -> list[Job]:
    """List the jobs of a round: the proposal in blocks of seeds, then the neighbours.

    Each block is a job, so that all cores work, and a kill costs one block.
    """
    first = OF_A_ROUND * (round_ + 1)
    block = section.block
    found = []
    for k, start in enumerate(range(0, section.seeds, block)):
        seeds = min(block, section.seeds - start)
        found.append(Job(first + 1 + k, PROPOSAL, seeds))
    for k in range(section.neighbours):
        sample = first + FIRST_NEIGHBOUR + k
        found.append(Job(sample, NEIGHBOUR, section.neighbour_seeds))
    return found


def round_of(sample: int) -> int:
    """Return the round to which a sample number belongs; -1 for a sample of the design."""
    return sample // OF_A_ROUND - 1


def goes_on(verdict: Verdict, before: Verdict | None = None) -> bool:
    """Decide whether another round has something to gain.

    It has if the targets are missed and there are new data to learn from. Where they are
    out of reach, the loop goes on as long as it comes nearer.

    Parameters
    ----------
    verdict : mapping
        Of the last round.
    before : mapping, optional
        Verdict of the round before it.
    """
    if verdict["outcome"] == "within" or verdict["usable"] <= 0:
        return False
    return not stuck(verdict, before)


def stuck(verdict: Verdict, before: Verdict | None) -> bool:
    """Decide whether a round with targets out of reach came no nearer than the last one."""
    if before is None or not verdict["out_of_reach"]:
        return False
    return verdict["objective"] >= before["objective"]


def judge(
    proposal: pd.DataFrame, runs: pd.DataFrame, study: Study, round_: int
) -> dict[str, Any]:
    """Judge a round by the runs of its proposal.

    Returns
    -------
    dict
        A row of batches.csv, with NaN for a missing number. `objective` is Eq. 11 of the
        simulated means; `out_of_reach` says whether the prediction itself is too far
        from a target.
    """
    targets = study.targets
    section = study.settings.refine
    rows = proposal[proposal["role"] == PROPOSAL]
    first = rows.iloc[0]
    runs_of_proposal = runs[runs["sample"].isin(rows["sample"])]
    summary = _summary(runs_of_proposal, targets)
    row: dict[str, Any] = {"round": round_}
    for name in study.parameters.names:
        row[name] = float(first[name])
    row["poured"] = len(runs_of_proposal)
    row["n_seeds"] = summary["n_seeds"]
    for target in targets:
        row |= _numbers(target, float(first[target.response.predicted]), summary)
    row["objective"] = _objective(summary, targets)

    predicted = first[list(targets.predicted)].to_numpy(float)
    deviation = abs(predicted - targets.aim)
    is_too_far = 100 * deviation > section.tolerance_percent * targets.whole
    row["out_of_reach"] = bool(is_too_far.any())
    row["outcome"], row["reason"] = _outcome(row, summary, study)
    warning = first["warning"]
    row["warning"] = "" if pd.isna(warning) else str(warning)
    return row


def objective_of(
    jobs_of_round: Sequence[tuple[int, str, int]], runs: pd.DataFrame, targets: Targets
) -> float:
    """Compute the `objective` of a round with these `jobs`."""
    samples = [sample for sample, role, _ in jobs_of_round if role == PROPOSAL]
    runs_of_proposal = runs[runs["sample"].isin(samples)]
    return _objective(_summary(runs_of_proposal, targets), targets)


def _objective(summary: Mapping[str, Any], targets: Targets) -> float:
    """Compute Eq. 11 for the means of a summary."""
    means = np.array([[summary[name] for name in targets.names]])
    objective = Objective(targets)(means)[0]
    return float(objective[0])


def _summary(runs: pd.DataFrame, targets: Targets) -> dict[str, Any]:
    """Compute means and errors of all runs of a proposal.

    Its status is ok if it is so in every bench test, or else that of the first bench
    test that failed.
    """
    runs = runs.astype(object).where(runs.notna(), None)
    summary: dict[str, Any] = {}
    for bench, columns in targets.benches.items():
        names = tuple(targets.names[k] for k in columns)
        rows = of_bench(runs, bench).to_dict("records")
        measured = summarise_runs(rows, Recorded(names))
        fewest = min(measured["n_seeds"], summary.get("n_seeds", measured["n_seeds"]))
        has_failed = summary.get("status", "ok") != "ok"
        # The earlier entries stay where an earlier bench test failed.
        summary = measured | summary if has_failed else summary | measured
        summary["n_seeds"] = fewest
    return {key: np.nan if value is None else value for key, value in summary.items()}


def _numbers(
    target: Target, predicted: float, summary: Mapping[str, Any]
) -> dict[str, float]:
    """Make the columns of one response in the row of a round."""
    response = target.response
    quantity = response.quantity
    aim = target.aim
    mean = summary[target.name]
    error = summary[response.error]
    deviation_in_errors = (mean - aim) / error if error > 0 else np.nan
    return {
        derived(response.name, "target"): aim,
        response.predicted: predicted,
        response.simulated: mean,
        response.error: error,
        f"{quantity}_deviation_percent": 100 * (mean - aim) / aim,
        f"{quantity}_se_percent": 100 * error / aim,
        f"{quantity}_deviation_se": deviation_in_errors,
        f"{quantity}_prediction_error_percent": 100 * (predicted - mean) / mean,
    }


def _outcome(
    row: Mapping[str, Any], summary: Mapping[str, Any], study: Study
) -> tuple[str, str]:
    """Return the outcome of a round, and the reason, empty for the outcome "within"."""
    if summary["status"] != "ok":
        return "no pile", f"{summary['status']}: {summary['reason']}"
    section = study.settings.refine
    is_far = False
    is_vague = False
    for target in study.targets:
        quantity = target.response.quantity
        deviation = row[f"{quantity}_deviation_percent"]
        error = row[f"{quantity}_se_percent"]
        is_far |= abs(deviation) > section.tolerance_percent
        # Also where the error is not known.
        is_vague |= not error < section.standard_error_percent
    if not is_far and not is_vague:
        return "within", ""
    reasons = [_deviation(row, target, section) for target in study.targets]
    outcome = "not within" if is_far else "not precise"
    return outcome, "; ".join(reasons)


def _deviation(row: Mapping[str, Any], target: Target, section: RefineSettings) -> str:
    """Say how far the simulated mean of a response is from its target."""
    response = target.response
    unit = response.unit
    deviation = row[f"{response.quantity}_deviation_percent"]
    error = row[f"{response.quantity}_se_percent"]
    deviation_in_errors = row[f"{response.quantity}_deviation_se"]

    in_errors = ""
    if np.isfinite(deviation_in_errors):
        in_errors = f" ({abs(deviation_in_errors):.1f} standard errors)"
    side = "above" if deviation > 0 else "below"
    text = (
        f"{response.symbol} {row[response.simulated]:.2f} {unit} is "
        f"{abs(deviation):.2f} %{in_errors} {side} {target.aim:g} {unit}"
    )
    if not abs(deviation) > section.tolerance_percent:
        text += f", within {section.tolerance_percent:g} %"
    if not error < section.standard_error_percent:
        known = f"is {error:.2f} %" if np.isfinite(error) else "is not known"
        text += (
            f", its standard error {known}, not below "
            f"{section.standard_error_percent:g} %"
        )
    return text


def why_stopped(
    verdict: Verdict, limit: int, targets: Targets, before: Verdict | None = None
) -> str:
    """Say why the loop ends after a round.

    Parameters
    ----------
    verdict : mapping
        Of the last round.
    limit : int
        The largest number of refits.
    targets : Targets
    before : mapping, optional
        Verdict of the round before the last.
    """
    round_ = f"round {verdict['round']}"
    reason = verdict["reason"]
    if verdict["outcome"] == "within":
        all_targets = {1: "the target", 2: "both targets"}
        return f"{round_} meets {all_targets.get(len(targets), 'all targets')}"
    if stuck(verdict, before):
        return (
            f"{round_} predicts that the targets are out of reach and came no nearer: "
            f"{reason}"
        )
    if not goes_on(verdict):
        return f"{round_} gave no pile to learn from ({reason})"
    return (
        f"the limit of {limit} refits is reached, and {round_} is "
        f"{verdict['outcome']}: {reason}"
    )


def claim(verdict: Verdict, targets: Targets) -> str:
    """Say what is claimed for the proposal of the last round, from its own runs."""
    if verdict["outcome"] == "no pile":
        return "none: the proposal gives no pile"
    values = []
    for response in targets.responses:
        mean = verdict[response.simulated]
        error = verdict[response.error]
        error_text = f"{error:.2f}" if np.isfinite(error) else "unknown"
        percent = verdict[f"{response.quantity}_deviation_percent"]
        values.append(
            f"{response.symbol} {mean:.2f} ± {error_text} {response.unit} "
            f"({percent:+.2f} %)"
        )
    return (
        f"{' and '.join(values)}, mean and standard error of {verdict['n_seeds']} fresh "
        "seeds, in no fit before"
    )
