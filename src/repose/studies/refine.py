"""The loop closed: the search's answer is simulated, added to the data, the surrogate refitted, the search run again.

Round 0 simulates the proposal of the main chain. Every round runs its proposal with many fresh seeds and a few
neighbours with fewer, and is judged by the simulated means of the proposal alone (`repose.studies.verdict`). As long as
these miss a target, all points so far join the training samples, the refitted surrogate is corrected near the last
proposal, and the search runs again there: docs/refinement.md says why.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from repose.chain import invert
from repose.chain.design import lhsdesign
from repose.core.parameter_space import ParameterSpace
from repose.core.parameters import PARAMETERS
from repose.core.seeds import PURPOSES
from repose.core.targets import Targets
from repose.studies.rounds import NEIGHBOUR, OF_A_ROUND, jobs, round_of
from repose.surrogate.base import Surrogate
from repose.surrogate.support import Support

WIDENING = (0.125, 0.25, 0.5, 1.0)  # shares of the box, tried in this order
MET = 0.1  # a prediction this share of the tolerance from the target meets it
ROUNDING = 1e-9  # of a place in the box, in ranges


def search_box(space: ParameterSpace, centre: Mapping[str, float], reach: float) -> ParameterSpace:
    """The ranges narrowed to a box about `centre`; `reach` is half the width of the box, in ranges."""
    middle = np.array([float(centre[name]) for name in space.free])
    step = reach * (space.high - space.low)
    return replace(
        space, low=np.maximum(space.low, middle - step), high=np.minimum(space.high, middle + step)
    )


def propose(
    solutions: pd.DataFrame,
    model: Surrogate,
    space: ParameterSpace,
    targets: Targets,
    section: Mapping[str, Any],
    round_: int,
    study_seed: int,
) -> pd.DataFrame:
    """The jobs of a round: the representative solution, and neighbours around it.

    The neighbours are a Latin hypercube in the box in which the next round searches. `solutions` is feasible.csv,
    `model` the searched surrogate, `section` is `refine`. Columns: sample, the six parameters, role, seeds,
    predictions, and the search's warning of the representative solution.
    """
    best = solutions[solutions["representative"]].iloc[0]
    table = pd.DataFrame(jobs(section, round_), columns=["sample", "role", "seeds"])
    near = table["role"] == NEIGHBOUR
    for name in PARAMETERS:
        table[name] = float(best[name])
    if near.any() and space.dimensions:
        rng = np.random.default_rng([study_seed, PURPOSES["refine"], OF_A_ROUND * (round_ + 1)])
        unit = lhsdesign(int(near.sum()), space.dimensions, rng=rng)
        table.loc[near, list(PARAMETERS)] = search_box(space, best, section["reach"]).values(unit)
    table[list(targets.predicted)] = model.predict(table[list(PARAMETERS)].to_numpy(float))
    warning = best.get("warning", "")
    table["warning"] = np.where(near, "", "" if pd.isna(warning) else warning)
    return table[["sample", *PARAMETERS, "role", "seeds", *targets.predicted, "warning"]]


def extended(design: pd.DataFrame, rounds: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """The samples, or runs, of a design and of all rounds so far as one table.

    The column round is empty for the design's own rows; all other rows are training samples of `repose.chain.train`.
    ValueError if a sample is there twice, or is numbered like the design's.
    """
    added = pd.concat(rounds, ignore_index=True)
    added["round"] = round_of(added["sample"])
    if (added["round"] < 0).any() or design["sample"].max() >= OF_A_ROUND:
        raise ValueError(f"samples are numbered alike; allowed: below {OF_A_ROUND} in the design alone")
    owners = [set(table["sample"]) for table in rounds]
    if len(set().union(*owners)) < sum(map(len, owners)):
        raise ValueError("rounds hold a sample twice; allowed: each round once")
    return pd.concat([design, added], ignore_index=True).astype({"round": "Int64"})


def corrected(
    model: Surrogate, dataset: pd.DataFrame, box: ParameterSpace, targets: Targets
) -> tuple[Surrogate, np.ndarray, int]:
    """The surrogate, shifted so that it meets the refined samples inside a box on average.

    The refit follows the whole design and keeps a few percent of error where it matters. The mean residual of the
    refined samples inside the box, weighted by their seeds, is added to its predictions. Returns a shifted copy, the
    offset (k,), and its number of samples. `dataset` is of `extended`. ValueError if no usable refined sample lies
    inside the box.
    """
    added = dataset[dataset["round"].notna() & (dataset["status"] == "ok")]
    points = added[list(box.free)].to_numpy(float)
    slack = ROUNDING * (box.high - box.low)
    inside = ((points >= box.low - slack) & (points <= box.high + slack)).all(axis=1)
    if not inside.any():
        raise ValueError("no usable refined sample inside the box; allowed: at least one")
    near = added[inside]
    left = near[list(targets.names)].to_numpy(float) - model.predict(near[list(PARAMETERS)].to_numpy(float))
    offset = np.average(left, axis=0, weights=near["n_seeds"].to_numpy(float))
    return model.shifted(offset), offset, len(near)


def search(
    model: Surrogate,
    dataset: pd.DataFrame,
    centre: Mapping[str, float],
    space: ParameterSpace,
    targets: Targets,
    config: Mapping[str, Any],
    published: pd.DataFrame | None = None,
    support: Support | None = None,
) -> tuple[Surrogate, invert.Inversion]:
    """Correct a surrogate near the last proposal and search there.

    The search begins in an eighth of the box of `refine.reach` and widens it until the targets are met: of all suitable
    parameter sets, one near the last proposal is wanted, where the correction holds. `model` is refitted to `dataset`
    (of `extended`); `centre` is the last proposal. The summary of the inversion also has reach, offset and
    offset_samples. ValueError if no usable refined sample lies near the last proposal.
    """
    reach, tolerance = config["refine"]["reach"], config["refine"]["tolerance_percent"] / 100
    model, offset, count = corrected(model, dataset, search_box(space, centre, reach), targets)
    for share in WIDENING:
        box = search_box(space, centre, share * reach)
        found = invert.invert(model, box, targets, config["miga"], published, support)
        off = [found.summary["target_distance"][target.name] / target.aim for target in targets]
        if max(off) < tolerance * MET:
            break
    near = {"reach": share * reach, "offset": dict(zip(targets.names, offset.tolist(), strict=True))}
    return model, replace(found, summary=found.summary | near | {"offset_samples": count})
