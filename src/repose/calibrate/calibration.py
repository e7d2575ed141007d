"""From the runs of any simulator to the answer with its certainty, its tables and its material card."""

from html import escape
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate.answer import (
    NOT_AGAIN,
    WITHIN,
    Check,
    Result,
    describe_probability,
    out_of_reach,
)
from repose.calibrate.strategies import answer
from repose.calibrate.strategies.base import Answer, Batch, Studied, strategy
from repose.calibrate.strategies.runs import OK, check_responses
from repose.calibrate.strategies.sequential.goal import Goal
from repose.calibrate.strategies.sequential.kriging import Kriging, SpaceKriging
from repose.calibrate.strategies.sequential.noise import REPLICATES
from repose.calibrate.strategies.sequential.strategy import noise_from, observed_of
from repose.calibrate.surrogates.base import Predictor
from repose.calibrate.surrogates.support import Support
from repose.calibrate.uncertainty.posterior import FREEDOM, Posterior, infer
from repose.calibrate.uncertainty.settings import PosteriorSettings
from repose.common.errors import require
from repose.common.files import Path_, path_of, write_json, write_table
from repose.stages import card

# Files of `save`.
TABLES = ("samples.csv", "solutions.csv", "posterior.csv", "draws.csv")
RECORDS = ("posterior.json", "summary.json", "card.json")


class Calibration(NamedTuple):
    """Result of a calibration by the runs of the user's simulator."""

    study: Studied
    runs: pd.DataFrame
    samples: pd.DataFrame  # means by sample, with standard errors
    model: Predictor
    answer: Answer
    solutions: pd.DataFrame  # the answer, then other sets predicted inside all ranges
    posterior: Posterior
    summary: dict[str, Any]  # the answer in plain values, as in ``summary.json``

    @property
    def parameters(self) -> dict[str, float]:
        """The answer by name."""
        return self.summary["representative"]

    @property
    def probability(self) -> dict[str, float]:
        """``within_1_percent``, ``within_2_percent`` and ``inside`` all ranges, for the simulator's means."""
        return self.answer.probability

    @property
    def why(self) -> str:
        """Why no more runs are needed."""
        return self.answer.why

    @property
    def intervals(self) -> dict[str, dict[str, Any]]:
        """The answer's values with their intervals, by name, as the material card has them."""
        space, values = self.study.parameters, self.parameters
        ends = card.ends(
            space, self.solutions, (self.posterior.parameters, self.posterior.draws)
        )
        return {
            name: {
                "value": values[name],
                **card.held(space, name, values[name], *ends[name]),
            }
            for name in space.names
        }

    @property
    def prediction(self) -> pd.DataFrame:
        """A row for each response: `target`, predicted `mean` and its standard `error`."""
        return pd.DataFrame(self.summary["responses"]).T

    @property
    def card(self) -> dict[str, Any]:
        """The material card, as `save` writes it."""
        study, draws = self.study, (self.posterior.parameters, self.posterior.draws)
        about = {"simulator": _simulator(study), "probability": self.probability}
        words, tests = _definitions(study), dict[str, Any]()
        for name in study.targets.names:
            tests[name] = {
                "definition": {"name": words.get(name), "settings": {}},
                "bench": None,
            }
        made = card.assembled(
            about, tests, self.as_answer(), study.parameters, self.solutions, draws
        )
        return made | {
            "made_by": made["made_by"] | {"seed": study.settings.design.seed}
        }

    def save(self, out_dir: Path_) -> None:
        """Write tables, summary and material card into a folder; docs/own_simulator.md lists the files."""
        out, made = path_of("out_dir", out_dir), self.card
        require(not out.is_file(), out, "file", "there already", "a folder")
        tables = (
            self.samples,
            self.solutions,
            self.posterior.parameters,
            self.posterior.draws,
        )
        for name, table in zip(TABLES, tables, strict=True):
            write_table(out / name, table)
        card.check(made, out / "card.json")
        for name, content in zip(
            RECORDS, (self.posterior.summary, self.summary, made), strict=True
        ):
            write_json(out / name, content)

    def report(self, path: Path_) -> None:
        """Write the page to read, one HTML file; it takes the extra `pictures`."""
        import_module("repose.report.page.own").write(
            self, path_of("path", path)
        )  # a room above this one

    def plot(self, path: Path_ | None = None) -> Any:
        """Draw runs, their history, intervals and posterior as a matplotlib Figure, and write it to `path` if given.

        The path ends in .png, .pdf or .svg. It takes the extra `pictures`.
        """
        return import_module("repose.report.figures.own").plot(
            self, None if path is None else path_of("path", path)
        )

    def as_answer(self) -> Result:
        """Put the answer in the form for the material card; it was not simulated again."""
        return Result(
            label=self.study.settings.label,
            parameters=self.parameters,
            feasible=self.summary["feasible"],
            message=self.summary["message"],
            checks=tuple(
                Check.of(
                    target,
                    simulated=None,
                    standard_error=None,
                    runs=0,
                    status=NOT_AGAIN,
                    predicted=mean,
                )
                for target, mean in zip(
                    self.study.targets, self.answer.mean.tolist(), strict=True
                )
            ),
            folder=Path(),
            out_of_reach=out_of_reach(self.summary),
            within={
                percent: self.probability[column] for percent, column in WITHIN.items()
            },
        )

    def __str__(self) -> str:
        best = self.answer
        lines = [self.as_answer().verdict, "The calibrated parameters [95 % interval]:"]
        for name, row in self.intervals.items():
            interval = (
                "fixed"
                if row["low"] is None
                else f"[{row['low']:.4g}, {row['high']:.4g}]"
            )
            lines.append(
                card.with_remark(f"  {name} {row['value']:.4g} {interval}", row)
            )
        lines.append(
            f"Predicted by {self.model.name.replace('_', ' ')}, not simulated again:"
        )
        for target, mean, error in zip(
            self.study.targets, best.mean, best.error, strict=True
        ):
            unit = f" {target.response.unit}".rstrip()
            off = target.off_percent(mean)
            aimed = f"{off:+.2f} % off the target {target.aim:g}, range {target.low:g} to {target.high:g}{unit}"
            lines.append(f"  {target.name}: {mean:.4g} +- {error:.2g}{unit}, {aimed}")
        lines.append(
            f"Probability that the simulator's means there lie {describe_probability(self.probability)}."
        )
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"<Calibration of {self.study.settings.label}>\n{self}"

    def _repr_html_(self) -> str:
        """Show the answer in a notebook: parameters with their intervals, predictions, probabilities."""
        parameters = pd.DataFrame(self.intervals).T.drop(
            columns=["at_bound", "widened"], errors="ignore"
        )
        chances = pd.DataFrame({"probability": self.probability}).rename(
            index=lambda name: name.replace("_", " ")
        )
        tables = (parameters, self.prediction, chances)
        shown = "".join(
            table.to_html(float_format="{:.4g}".format, na_rep="fixed")
            for table in tables
        )
        return (
            f"{shown}<p>{escape(self.summary['message'])}</p><p>{escape(self.why)}</p>"
        )


def calibrate(
    study: Studied, runs: pd.DataFrame, proposal: Batch | Answer | None = None
) -> Calibration:
    """Find the parameters that meet the targets, and how certain they are.

    `runs` come from `repose.calibrate.strategies.runs.checked_runs`; the strategy need not have asked for them. Unless
    `proposal` is the answer, it is the best that these runs give.
    """
    space, targets, settings = study.parameters, study.targets, study.settings
    check_responses(runs, targets)
    best = (
        proposal
        if isinstance(proposal, Answer)
        else strategy(settings.strategy).answer(study, runs)
    )
    observed = observed_of(runs, space, targets)
    noise = noise_from(study, observed)
    model = best.model or SpaceKriging(Kriging(observed, noise.covariance), space)
    samples = _samples(study, runs)
    support = Support.of(space.values(observed.unit), space)
    vary = REPLICATES in noise.sources.values()
    posterior = infer(
        model,
        support,
        runs,
        study,
        posterior_settings(study, observed.freedom if vary else 0),
        {},
    )
    feasible, message = answer.verdict(best, targets)
    goal = Goal.of(targets, settings.sequential.tolerance_percent, space)
    summary = {
        "simulator": _simulator(study),
        "representative": dict(zip(space.names, best.values.tolist(), strict=True)),
        "responses": {
            target.name: {
                "target": target.aim,
                "mean": float(mean),
                "error": float(error),
            }
            for target, mean, error in zip(targets, best.mean, best.error, strict=True)
        },
        "feasible": feasible,
        "message": message,
        **({"stop": best.notes["stop"]} if "stop" in best.notes else {}),
        "probability": best.probability,
        "runs": len(runs),
        "failed_runs": int((runs["status"] != OK).sum()),
        "samples": len(samples),
        "needed": goal.needed(noise.covariance, settings.sequential.probability),
        "noise": {
            name: {"sd": float(sd), "from": noise.sources[name]}
            for name, sd in zip(
                targets.names, np.sqrt(np.diagonal(noise.covariance)), strict=True
            )
        },
        "warning": noise.warning,
        "definitions": _definitions(study),
        "steps": _steps(study, runs, len(samples), model, best, noise.warning),
    }
    solutions = answer.solutions(best, feasible, space, targets)
    return Calibration(study, runs, samples, model, best, solutions, posterior, summary)


def posterior_settings(study: Studied, freedom: int) -> PosteriorSettings:
    """Return the section `posterior`; without a correlation where too few samples were run again for one."""
    few = (
        {"measured_correlation": 0.0} if freedom < len(study.targets) + FREEDOM else {}
    )
    own = (
        {"shape_study": None, "measured_correlation": "simulated"}
        | study.settings.posterior.model_dump()
        | few
    )
    return PosteriorSettings.model_construct(**own)


def _simulator(study: Studied) -> str:
    """Return the name of the simulator."""
    return str(getattr(study.settings, "simulator", "repose"))


def _definitions(study: Studied) -> dict[str, str]:
    """Return how the responses of a simulator of the user's own are taken, in the user's words."""
    return dict(getattr(study.settings, "definitions", {}))


def _samples(study: Studied, runs: pd.DataFrame) -> pd.DataFrame:
    """Average the runs of each sample, with standard errors."""
    ok = runs[runs["status"] == OK].groupby("sample", sort=False)
    first = runs.drop_duplicates("sample").set_index("sample")
    table = first[list(study.parameters.names)].assign(
        runs=ok.size().reindex(first.index, fill_value=0)
    )
    for name, error in zip(study.targets.names, study.targets.errors, strict=True):
        table[name], table[error] = ok[name].mean(), ok[name].sem()
    return table.reset_index()


def _steps(
    study: Studied,
    runs: pd.DataFrame,
    samples: int,
    model: Predictor,
    best: Answer,
    warning: str | None,
) -> list[str]:
    """Describe the way to the answer, in sentences."""
    settings, failed = study.settings, int((runs["status"] != OK).sum())
    name = model.name.replace("_", " ")
    known = (
        " of the samples' means with their known errors"
        if model.name == "kriging" and warning is None
        else ""
    )
    one, two = (
        best.probability["within_1_percent"],
        best.probability["within_2_percent"],
    )
    likely = f"the set that lies within {settings.sequential.tolerance_percent:g} % of all targets most probably"
    own = (
        "the set that comes nearest to the targets" if "nearest" in best.why else likely
    )
    chosen = (
        own
        if settings.strategy == "sequential"
        else f"that of the strategy {settings.strategy}"
    )
    return [
        f"Simulation in {_simulator(study)}: {len(runs)} runs of {samples} parameter sets, {failed} failed.",
        f"Model: {name}{known}."
        if warning is None
        else f"Model: {name}. Warning: {warning}",
        f"Answer: {chosen}; within 1 % with probability {one:.2f}, within 2 % with {two:.2f}.",
        *(f"{name}: {text}." for name, text in _definitions(study).items()),
    ]
