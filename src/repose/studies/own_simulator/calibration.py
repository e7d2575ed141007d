"""From the runs of the user's simulator to the next runs, and to the answer with its certainty."""

import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.chain import card
from repose.chain.answer import WITHIN, Answer, Check
from repose.core.files import write_json, write_table
from repose.strategies import answer
from repose.strategies.sequential.advise import Advice, advise, alternatives, ranked
from repose.strategies.sequential.goal import Goal
from repose.strategies.sequential.kriging import Kriging, Observed, SpaceKriging
from repose.studies.own_simulator.noise import noise_of
from repose.studies.own_simulator.runs import OK, runs_of_points
from repose.studies.own_simulator.study import OwnStudy
from repose.studies.posterior import Posterior, infer
from repose.surrogate.support import Support

SOLUTIONS, DISTANCE = 90, 0.02  # as `miga` of config.yaml
FREEDOM = 4  # runs beyond the first of a sample, needed for a correlation of two responses


class Calibration(NamedTuple):
    """Result of a calibration by the runs of the user's simulator."""

    study: OwnStudy
    runs: pd.DataFrame
    samples: pd.DataFrame  # means by sample, with standard errors
    model: SpaceKriging
    values: np.ndarray  # parameters of the answer
    mean: np.ndarray  # its predicted responses (k,)
    error: np.ndarray  # their standard errors (k,)
    probability: dict[str, float]  # ``within_1_percent``, ``within_2_percent``, ``inside`` all ranges
    solutions: pd.DataFrame  # the answer, then other sets predicted inside all ranges
    posterior: Posterior
    summary: dict[str, Any]  # the answer in plain values, as in ``summary.json``


def ask(study: OwnStudy, runs: pd.DataFrame) -> tuple[Advice, pd.DataFrame]:
    """Advice on the next runs, and a row for each of them; where the runs stop (``stop``), the answer.

    `runs` are all runs so far, from `checked_runs`. InputError if they do not determine the noise.
    """
    observed, failed = observed_of(study, runs)
    noise = noise_of(study, observed).covariance
    goal = Goal.of(study.targets, study.sequential["tolerance_percent"], study.space)
    random = np.random.default_rng([study.seed, len(runs)])
    advice = advise(observed, failed, goal, study.sequential, len(runs), random, noise)
    numbers = pd.to_numeric(runs["sample"], errors="coerce")
    first = int(numbers.max()) + 1 if numbers.notna().all() else runs["sample"].nunique() + 1
    points = advice.answer[None] if advice.stop else advice.batch
    return advice, runs_of_points(points, study.space, study.sequential["seeds"], first)


def calibrate(study: OwnStudy, runs: pd.DataFrame) -> Calibration:
    """The parameters that meet the targets most probably, and their certainty.

    `runs` come from `checked_runs`; they need not come from `ask`. InputError if they do not determine the noise.
    """
    space, targets = study.space, study.targets
    observed, failed = observed_of(study, runs)
    noise = noise_of(study, observed)
    model = SpaceKriging(Kriging(observed, noise.covariance), space)
    goal = Goal.of(targets, study.sequential["tolerance_percent"], space)
    random = np.random.default_rng([study.seed, len(runs)])
    points, scores = ranked(model.model, goal, observed.unit, failed, random)
    best = points[scores.argmax()][None]
    mean, covariance = model.model.predict(best)
    others, predicted = alternatives(
        points, scores, model.model, targets, {"solutions": SOLUTIONS, "distance": DISTANCE}
    )
    samples = _samples(study, runs)
    low, high = space.complete(np.array([space.low, space.high]))
    support = Support(space.values(observed.unit), low, high, space.names)
    settings = dict(study.posterior) | {"seed": study.seed}
    if observed.freedom < FREEDOM:
        settings |= {"measured_correlation": 0.0}
    posterior = infer(model, support, runs, space, targets, settings, {})
    probability = {
        column: float(Goal.of(targets, percent, space).probability(mean, covariance)[0])
        for percent, column in WITHIN.items()
    }
    probability["inside"] = goal.inside(mean, covariance, targets)
    found = answer.Found(space.values(best)[0], mean[0], space.values(others), predicted, ())
    feasible, message = answer.verdict(found, targets)
    solutions = answer.solutions(found, feasible, space, targets)
    errors = np.sqrt(np.diagonal(covariance[0]))
    summary = {
        "simulator": study.simulator,
        "representative": dict(zip(space.names, found.values.tolist(), strict=True)),
        "responses": {
            one.name: {"target": one.aim, "mean": float(m), "error": float(e)}
            for one, m, e in zip(targets, mean[0], errors, strict=True)
        },
        "feasible": feasible,
        "message": message,
        "probability": probability,
        "runs": len(runs),
        "failed_runs": int((runs["status"] != OK).sum()),
        "samples": len(samples),
        "needed": goal.needed(model.model.noise, study.sequential["probability"]),
        "noise": {
            name: {"sd": float(sd), "from": noise.sources[name]}
            for name, sd in zip(targets.names, np.sqrt(np.diagonal(noise.covariance)), strict=True)
        },
        "warning": noise.warning,
        "definitions": dict(study.definitions),
        "steps": _steps(study, runs, samples, probability, noise.warning),
    }
    given = (found.values, mean[0], errors, probability, solutions, posterior, summary)
    return Calibration(study, runs, samples, model, *given)


def observed_of(study: OwnStudy, runs: pd.DataFrame) -> tuple[Observed, np.ndarray]:
    """Samples with a good run as arrays, and the other samples (f, d) in the unit cube."""
    names = list(study.targets.names)
    number, samples = pd.factorize(runs["sample"])
    place = runs.groupby("sample").cumcount().to_numpy()
    values = np.full((len(samples), int(place.max()) + 1, len(names)), np.nan)
    values[number, place] = runs[names].to_numpy(float)
    first = runs.drop_duplicates("sample")[list(study.space.names)].to_numpy(float)
    unit, good = study.space.unit(first), np.isfinite(values).all(axis=2).any(axis=1)
    return Observed(unit[good], values[good]), unit[~good]


def write(found: Calibration, out_dir: str | os.PathLike) -> dict[str, Any]:
    """Write the tables of a calibration and its material card; return the card.

    The files are samples.csv, solutions.csv, posterior.csv, draws.csv, posterior.json, summary.json and card.json.
    """
    out, study = Path(out_dir), found.study
    tables = {"samples": found.samples, "solutions": found.solutions}
    tables |= {"posterior": found.posterior.parameters, "draws": found.posterior.draws}
    for name, table in tables.items():
        write_table(out / f"{name}.csv", table)
    write_json(out / "posterior.json", found.posterior.summary)
    write_json(out / "summary.json", found.summary)
    about = {"simulator": study.simulator, "probability": found.probability}
    tests: dict[str, dict[str, Any]] = {
        name: {"definition": {"name": study.definitions.get(name), "settings": {}}, "bench": None}
        for name in study.targets.names
    }
    made = card.assembled(
        about,
        tests,
        as_answer(found, out),
        study.space,
        study.targets,
        found.solutions,
        (found.posterior.parameters, found.posterior.draws),
    )
    card.check(made, out / "card.json")
    write_json(out / "card.json", made)
    return made


def as_answer(found: Calibration, folder: Path) -> Answer:
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
    return Answer(found.study.label, values, summary["feasible"], summary["message"], checks, folder, within)


def in_words(found: Calibration) -> str:
    """The answer as text for people."""
    rows = found.posterior.parameters.set_index("parameter")
    study, chance = found.study, found.probability
    lines = [f"{study.label}: the calibrated parameters [95 % interval]:"]
    for name, value in found.summary["representative"].items():
        interval = "fixed"
        if name in rows.index:
            interval = "[{credible_low:.4g}, {credible_high:.4g}]".format(**rows.loc[name])
        lines.append(f"  {name} {value:.4g} {interval}")
    lines.append("Predicted by kriging, not simulated again:")
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
    table = first[list(study.space.names)].assign(runs=ok.size().reindex(first.index, fill_value=0))
    for one in study.targets:
        table[one.name] = ok[one.name].mean().reindex(first.index)
        table[one.response.error] = ok[one.name].sem().reindex(first.index)
    return table.reset_index()


def _steps(study, runs, samples, probability, warning):
    """The way to the answer, in sentences."""
    failed = int((runs["status"] != OK).sum())
    return [
        f"Simulation in {study.simulator}: {len(runs)} runs of {len(samples)} parameter sets, {failed} failed.",
        "Model: kriging of the samples' means with their known errors."
        if warning is None
        else f"Model: kriging. Warning: {warning}",
        f"Answer: the set that lies within {study.sequential['tolerance_percent']:g} % of all targets most probably; "
        f"within 1 % with probability {probability['within_1_percent']:.2f}, "
        f"within 2 % with {probability['within_2_percent']:.2f}.",
        *(f"{name}: {text}." for name, text in study.definitions.items()),
    ]
