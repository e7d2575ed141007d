"""The strategy `response_surface` as steps: what each proposes follows from the runs of the steps before it."""

from collections.abc import Iterator, Mapping
from typing import Any, Literal

import numpy as np
import pandas as pd
from pydantic import Field

from repose.core.parameter_space import ParameterSpace
from repose.core.section import Section, Seeds
from repose.doe.box_behnken import box_behnken
from repose.doe.central_composite import central_composite
from repose.strategies.base import Answer, Batch, Strategy, Studied, register, samples_of
from repose.strategies.published import probability_of
from repose.strategies.response_surface import screening, surface
from repose.strategies.response_surface.steps import fewest_factors
from repose.strategies.runs import next_number, samples_of_runs


class Settings(Section):
    """Screening, steepest ascent and a quadratic surface."""

    seeds: Seeds
    screening_runs: Literal[8, 12, 16, 20, 24]
    significance: float = Field(gt=0, le=0.5)
    most_factors: int = Field(ge=2, le=6)
    steps: int = Field(ge=1, le=50)
    surface: Literal["box_behnken", "rotatable", "face_centred"]
    centres: int = Field(ge=1, le=50)
    reach: float = Field(ge=0.01, le=0.5)
    checks: int = Field(ge=2, le=500)


@register("response_surface")
class ResponseSurface(Strategy):
    """Screening, steepest ascent, surface, check: each a batch."""

    settings = Settings
    repeats_points = True

    def propose(self, study: Studied, data: pd.DataFrame) -> Batch | Answer:
        space, targets, section = study.parameters, study.targets, study.config["response_surface"]

        def batch(table):
            return Batch(table[["sample", *space.names]].assign(seeds=section["seeds"]))

        table = screening.design(space, section)
        if _lacks(data, table):
            return batch(table)
        dataset = samples_of_runs(data, space, targets)
        path = screening.screened(table, dataset, space, targets, section, "runs").path
        if _lacks(data, path):
            return batch(path)
        table = surface.design(surface.walked(path, dataset, targets), space, section)
        if _lacks(data, table):
            return batch(table)
        models = screening.models_of(table, dataset, targets, "quadratic", "runs")
        best = surface.best_point(models, targets)
        check = surface.check_samples(table, best, space, section)
        if _lacks(data, check):
            return batch(check)
        others, predicted = surface.alternatives(models, table, space, targets, study.config)
        unit = surface.natural_unit(table, best.coded, space)
        error = np.array([float(one.standard_error(best.coded[None])[0]) for one in models])
        mean, covariance = best.predicted, np.diag(error**2)
        return Answer(
            space.values(unit)[0],
            mean,
            covariance,
            probability_of(mean[None], covariance[None], targets),
            samples_of(space, unit, section["checks"], next_number(data)),
            "the optimum of the surfaces is simulated",
            others,
            predicted,
        )

    def contradictions(self, config: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """A response surface of too few factors or runs."""
        section, free = config["response_surface"], _free(config)
        name, fewest = section["surface"], fewest_factors(section)
        centres = 3 if name == "box_behnken" else 1
        if free < fewest:
            yield "response_surface.surface", f"a design for {free} free parameters; {name} needs {fewest}"
        if section["most_factors"] < fewest:
            yield "response_surface.most_factors", f"at least {fewest} where surface is {name}"
        if section["screening_runs"] < free + 2:
            yield "response_surface.screening_runs", f"at least {free + 2} for {free} free parameters"
        if section["centres"] < centres:
            yield "response_surface.centres", f"at least {centres} where surface is {name}"

    def pours(self, config: Mapping[str, Any]) -> tuple[tuple[str, int, int], ...]:
        """The steps; the screening may keep fewer parameters than `response_surface.most_factors`."""
        section = config["response_surface"]
        factors = min(section["most_factors"], _free(config))
        if section["surface"] == "box_behnken":
            runs = len(box_behnken(factors, section["centres"])[0])
        else:
            runs = len(central_composite(factors, section["surface"], section["centres"])[0])
        steps = (
            ("screening", section["screening_runs"] + section["centres"]),
            ("ascent", section["steps"] + 1),
            ("surface", runs),
            ("check", section["checks"]),
        )
        return tuple((name, sets, section["seeds"]) for name, sets in steps)


def _free(config):
    """Number of free parameters."""
    section = config["parameters"]
    return ParameterSpace.of(section, names=tuple(section)).dimensions


def _lacks(data, table):
    """Whether a step is not simulated yet."""
    return data.empty or not data["sample"].isin(table["sample"]).any()
