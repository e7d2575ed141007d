"""From the runs of any simulator to the answer with its certainty, its tables and its material card."""

import os
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.chain import card
from repose.chain.answer import WITHIN, Check
from repose.chain.answer import Answer as Result
from repose.core.files import write_json, write_table
from repose.strategies import answer
from repose.strategies.base import Answer, Batch, Studied, strategy
from repose.strategies.runs import OK
from repose.strategies.sequential.goal import Goal
from repose.strategies.sequential.kriging import Kriging, SpaceKriging
from repose.strategies.sequential.strategy import noise_from, observed_of
from repose.studies.posterior import Posterior, infer
from repose.surrogate.base import Predictor
from repose.surrogate.support import Support

FREEDOM = 4  # runs beyond the first of a sample, needed for a correlation of two responses


class Calibration(NamedTuple):
    """Result of a calibration by the runs of the user's simulator."""

    study: Studied
    runs: pd.DataFrame
    samples: pd.DataFrame  # means by sample, with standard errors
    model: Predictor
    values: np.ndarray  # parameters of the answer
    mean: np.ndarray  # its predicted responses (k,)
    error: np.ndarray  # their standard errors (k,)
    probability: dict[str, float]  # ``within_1_percent``, ``within_2_percent``, ``inside`` all ranges
    solutions: pd.DataFrame  # the answer, then other sets predicted inside all ranges
    posterior: Posterior
    summary: dict[str, Any]  # the answer in plain values, as in ``summary.json``
    why: str  # no more runs are needed

    @property
    def parameters(self) -> dict[str, float]:
        """The answer by name."""
        return self.summary["representative"]

    @property
    def prediction(self) -> pd.DataFrame:
        """A row for each response: `target`, predicted `mean` and its standard `error`."""
        return pd.DataFrame(self.summary["responses"]).T

    def _repr_html_(self) -> str:
        """The answer in a notebook: parameters with their intervals, predictions, probabilities."""
        intervals = self.posterior.parameters.set_index("parameter")[["credible_low", "credible_high"]]
        parameters = pd.DataFrame({"value": self.parameters}).join(intervals)
        chances = pd.DataFrame({"probability": self.probability}).rename(
            index=lambda name: name.replace("_", " ")
        )
        tables = (parameters, self.prediction, chances)
        shown = "".join(one.to_html(float_format="{:.4g}".format, na_rep="fixed") for one in tables)
        return f"{shown}<p>{escape(self.summary['message'])}</p><p>{escape(self.why)}</p>"


def calibrate(study: Studied, runs: pd.DataFrame, found: Batch | Answer | None = None) -> Calibration:
    """The parameters that meet the targets, and their certainty.

    `runs` come from `repose.strategies.runs.checked_runs`; they need not be those that the strategy asked for. Unless
    `found` is the answer, it is the best that these runs give.
    """
    space, targets, config = study.parameters, study.targets, study.config
    if not isinstance(found, Answer):
        found = strategy(config["strategy"]).answer(study, runs)
    observed, _ = observed_of(runs, space, targets)
    noise = noise_from(study, observed)
    model = found.model or SpaceKriging(Kriging(observed, noise.covariance), space)
    samples = _samples(study, runs)
    low, high = space.complete(np.array([space.low, space.high]))
    support = Support(space.values(observed.unit), low, high, space.names)
    settings = dict(config["posterior"])
    if observed.freedom < FREEDOM:
        settings |= {"measured_correlation": 0.0}
    posterior = infer(model, support, runs, space, targets, settings, {})
    written = answer.Found(found.values, found.mean, found.others, found.others_mean, ())
    feasible, message = answer.verdict(written, targets)
    section = config["sequential"]
    goal = Goal.of(targets, section["tolerance_percent"], space)
    summary = {
        "simulator": config.get("simulator", "repose"),
        "representative": dict(zip(space.names, found.values.tolist(), strict=True)),
        "responses": {
            one.name: {"target": one.aim, "mean": float(m), "error": float(e)}
            for one, m, e in zip(targets, found.mean, found.error, strict=True)
        },
        "feasible": feasible,
        "message": message,
        "probability": found.probability,
        "runs": len(runs),
        "failed_runs": int((runs["status"] != OK).sum()),
        "samples": len(samples),
        "needed": goal.needed(noise.covariance, section["probability"]),
        "noise": {
            name: {"sd": float(sd), "from": noise.sources[name]}
            for name, sd in zip(targets.names, np.sqrt(np.diagonal(noise.covariance)), strict=True)
        },
        "warning": noise.warning,
        "definitions": dict(config.get("definitions", {})),
        "steps": _steps(study, runs, samples, model, found.probability, noise.warning),
    }
    solutions = answer.solutions(written, feasible, space, targets)
    given = (found.values, found.mean, found.error, found.probability, solutions, posterior, summary)
    return Calibration(study, runs, samples, model, *given, found.why)


def write(found: Calibration, out_dir: str | os.PathLike) -> dict[str, Any]:
    """Write the tables of a calibration and its material card; return the card."""
    out, study = Path(out_dir), found.study
    tables = {"samples": found.samples, "solutions": found.solutions}
    tables |= {"posterior": found.posterior.parameters, "draws": found.posterior.draws}
    for name, table in tables.items():
        write_table(out / f"{name}.csv", table)
    write_json(out / "posterior.json", found.posterior.summary)
    write_json(out / "summary.json", found.summary)
    about = {"simulator": study.config.get("simulator", "repose"), "probability": found.probability}
    tests: dict[str, dict[str, Any]] = {
        name: {"definition": {"name": study.config["definitions"].get(name), "settings": {}}, "bench": None}
        for name in study.targets.names
    }
    made = card.assembled(
        about,
        tests,
        as_answer(found, out),
        study.parameters,
        study.targets,
        found.solutions,
        (found.posterior.parameters, found.posterior.draws),
    )
    card.check(made, out / "card.json")
    write_json(out / "card.json", made)
    return made


def as_answer(found: Calibration, folder: Path) -> Result:
    """The answer in the form for the material card; it was not simulated again."""
    checks = tuple(
        Check(
            *(one.name, one.response.unit, None, None, 0, "not simulated again"),
            *(one.value, one.sd, one.low, one.high),
        )
        for one in found.study.targets
    )
    values, chance = found.summary["representative"], found.probability
    within = {percent: chance[column] for percent, column in WITHIN.items()}
    summary = found.summary
    return Result(
        found.study.config["label"], values, summary["feasible"], summary["message"], checks, folder, within
    )


def in_words(found: Calibration) -> str:
    """The answer as text for people."""
    rows = found.posterior.parameters.set_index("parameter")
    study, chance = found.study, found.probability
    lines = [f"{study.config['label']}: the calibrated parameters [95 % interval]:"]
    for name, value in found.summary["representative"].items():
        interval = "fixed"
        if name in rows.index:
            interval = "[{credible_low:.4g}, {credible_high:.4g}]".format(**rows.loc[name])
        lines.append(f"  {name} {value:.4g} {interval}")
    lines.append(f"Predicted by {found.model.name.replace('_', ' ')}, not simulated again:")
    for one, mean, error in zip(study.targets, found.mean, found.error, strict=True):
        unit = f" {one.response.unit}".rstrip()
        off = 100 * (mean / one.aim - 1)
        lines.append(
            f"  {one.name}: {mean:.4g} +- {error:.2g}{unit}, {off:+.2f} % off the target {one.aim:g}"
        )
    lines.append(
        f"Probability that the simulator's means there lie within 1 % of all targets: "
        f"{chance['within_1_percent']:.2f}; within 2 %: {chance['within_2_percent']:.2f}; inside all ranges: "
        f"{chance['inside']:.2f}."
    )
    return "\n".join([*lines, found.summary["message"]])


def _samples(study, runs):
    """Means of the samples with standard errors."""
    ok = runs[runs["status"] == OK].groupby("sample", sort=False)
    first = runs.drop_duplicates("sample").set_index("sample")
    table = first[list(study.parameters.names)].assign(runs=ok.size().reindex(first.index, fill_value=0))
    for one in study.targets:
        table[one.name] = ok[one.name].mean().reindex(first.index)
        table[one.response.error] = ok[one.name].sem().reindex(first.index)
    return table.reset_index()


def _steps(study, runs, samples, model, probability, warning):
    """The way to the answer, in sentences."""
    config, failed = study.config, int((runs["status"] != OK).sum())
    name = model.name.replace("_", " ")
    known = (
        " of the samples' means with their known errors"
        if model.name == "kriging" and warning is None
        else ""
    )
    chances = (
        f"within 1 % with probability {probability['within_1_percent']:.2f}, "
        f"within 2 % with {probability['within_2_percent']:.2f}."
    )
    if config["strategy"] == "sequential":
        tolerance = config["sequential"]["tolerance_percent"]
        chosen = f"the set that lies within {tolerance:g} % of all targets most probably"
    else:
        chosen = f"that of the strategy {config['strategy']}"
    return [
        f"Simulation in {config.get('simulator', 'repose')}: {len(runs)} runs of {len(samples)} parameter sets, "
        f"{failed} failed.",
        f"Model: {name}{known}." if warning is None else f"Model: {name}. Warning: {warning}",
        f"Answer: {chosen}; {chances}",
        *(f"{name}: {text}." for name, text in config.get("definitions", {}).items()),
    ]
