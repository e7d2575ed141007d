"""How one round of the refinement follows from another.

Round 0 simulates the proposal of the first search. Each round runs its proposal with many
fresh seeds and a few neighbours with fewer. It is judged by the simulated means of the
proposal alone (`repose.calibrate.strategies.refined.rounds`). While these miss a target,
all samples so far join the training, the refitted surrogate is corrected near the last
proposal, and the search runs again there. docs/refinement.md says why.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd

from repose.calibrate import inversion as invert
from repose.calibrate.designs.latin_hypercube import lhsdesign
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.seeds import PURPOSES
from repose.calibrate.strategies.refined.rounds import NEIGHBOUR, OF_A_ROUND, jobs
from repose.calibrate.study import Study
from repose.calibrate.surrogates.base import Surrogate
from repose.calibrate.surrogates.support import Support
from repose.calibrate.targets import Targets
from repose.common.errors import InputError

# Shares of the box that are searched, in this order.
WIDENING = (0.125, 0.25, 0.5, 1.0)
# A prediction meets a target from which it is this share of the tolerance away.
MET = 0.1
# Rounding of a point at the edge of the box, in ranges.
ROUNDING = 1e-9


class Correction(NamedTuple):
    """A surrogate that was shifted by its residuals near a proposal."""

    model: Surrogate
    offset: np.ndarray  # (k,), the shift
    n_samples: int  # of the residuals


def search_box(
    space: ParameterSpace, centre: Mapping[str, float], reach: float
) -> ParameterSpace:
    """Narrow the ranges to a box about `centre`.

    `reach` is half the width of the box, in ranges.
    """
    middle = np.array([float(centre[name]) for name in space.free])
    half_width = reach * (space.high - space.low)
    low = np.maximum(space.low, middle - half_width)
    high = np.minimum(space.high, middle + half_width)
    return replace(space, low=low, high=high)


def propose(
    solutions: pd.DataFrame, model: Surrogate, study: Study, round_: int
) -> pd.DataFrame:
    """List the jobs of a round: the proposal, and its neighbours.

    The neighbours are a Latin hypercube in the box in which the next round searches.

    Parameters
    ----------
    solutions : pandas.DataFrame
        The content of feasible.csv; its representative is the proposal.
    model : Surrogate
        It predicts the responses of the jobs.
    study : Study
    round_ : int
        Number of the round, from 0.

    Returns
    -------
    pandas.DataFrame
        `sample`, parameters, `role`, `seeds`, predicted responses, and `warning`.
    """
    space = study.parameters
    names = list(space.names)
    predicted = list(study.targets.predicted)
    section = study.settings.refine
    best = solutions[solutions["representative"]].iloc[0]
    table = pd.DataFrame(jobs(section, round_), columns=["sample", "role", "seeds"])
    is_neighbour = table["role"] == NEIGHBOUR

    for name in names:
        table[name] = float(best[name])
    if is_neighbour.any() and space.dimensions:
        stream = OF_A_ROUND * (round_ + 1)
        seeds = [study.settings.design.seed, PURPOSES["refined"], stream]
        rng = np.random.default_rng(seeds)
        unit = lhsdesign(int(is_neighbour.sum()), space.dimensions, rng=rng)
        box = search_box(space, best, section.reach)
        table.loc[is_neighbour, names] = box.values(unit)

    table[predicted] = model.predict(table[names].to_numpy(float))
    warning = best.get("warning", "")
    if pd.isna(warning):
        warning = ""
    table["warning"] = np.where(is_neighbour, "", warning)
    return table[["sample", *names, "role", "seeds", *predicted, "warning"]]


def correct_near(
    model: Surrogate, dataset: pd.DataFrame, box: ParameterSpace, targets: Targets
) -> Correction:
    """Shift a copy of the surrogate by its mean residual inside a box.

    A refit follows the whole design and keeps an error of a few percent near the
    proposal. The residuals are those of the refined samples, weighted by their seeds.

    Parameters
    ----------
    model : Surrogate
    dataset : pandas.DataFrame
        All samples; `round` is empty for the samples of the design.
    box : ParameterSpace
    targets : Targets

    Raises
    ------
    InputError
        If no refined sample is inside the box.
    """
    is_refined = dataset["round"].notna() & (dataset["status"] == "ok")
    refined = dataset[is_refined]
    points = refined[list(box.free)].to_numpy(float)
    slack = ROUNDING * (box.high - box.low)
    is_inside = (points >= box.low - slack) & (points <= box.high + slack)
    near = refined[is_inside.all(axis=1)]
    if near.empty:
        allowed = "at least one that is ok, near the last proposal"
        raise InputError("runs", "samples of the rounds", 0, allowed)
    simulated = near[list(targets.names)].to_numpy(float)
    residuals = simulated - model.predict(near[list(box.names)].to_numpy(float))
    seeds = near["n_seeds"].to_numpy(float)
    offset = np.average(residuals, axis=0, weights=seeds)
    return Correction(model.shifted(offset), offset, len(near))


def search(
    model: Surrogate,
    dataset: pd.DataFrame,
    centre: Mapping[str, float],
    study: Study,
    support: Support | None = None,
) -> tuple[Surrogate, invert.Inversion]:
    """Correct a surrogate near the last proposal, and search there.

    The search begins in an eighth of the box of `refine.reach` and widens it until the
    targets are met: of all suitable parameter sets, one near the last proposal is best,
    since the correction holds there.

    Parameters
    ----------
    model : Surrogate
        Fitted to the dataset.
    dataset : pandas.DataFrame
        All samples, as in `corrected`.
    centre : mapping
        The parameters of the last proposal.
    study : Study
    support : Support, optional
        Region of the samples; sets beyond it get a warning.

    Returns
    -------
    Surrogate
        The corrected one.
    Inversion
        Its summary also has `reach`, `offset` and `offset_samples`.
    """
    space = study.parameters
    targets = study.targets
    section = study.settings.refine
    tolerance = section.tolerance_percent / 100
    largest_box = search_box(space, centre, section.reach)
    correction = correct_near(model, dataset, largest_box, targets)
    for share in WIDENING:
        reach = share * section.reach
        box = search_box(space, centre, reach)
        inversion = invert.invert(
            correction.model, box, targets, study.settings.miga, support=support
        )
        distances = inversion.summary["target_distance"]
        deviations = [distances[target.name] / target.whole for target in targets]
        if max(deviations) < tolerance * MET:
            break
    offset = dict(zip(targets.names, correction.offset.tolist(), strict=True))
    summary = inversion.summary | {
        "reach": reach,
        "offset": offset,
        "offset_samples": correction.n_samples,
    }
    return correction.model, inversion._replace(summary=summary)
