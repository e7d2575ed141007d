"""The loop closed: the search's answer is simulated, added to the data, the surrogate refitted, the search run again.

Round 0 simulates the proposal of the main chain. Every round runs its proposal with many fresh seeds and a few
neighbours with fewer, and is judged by the simulated means of the proposal alone (`repose.calibrate.strategies.refined.rounds`).
As long as these miss a target, all points so far join the training samples, the refitted surrogate is corrected near
the last proposal, and the search runs again there: docs/refinement.md says why.
"""

from collections.abc import Mapping
from dataclasses import replace

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
from repose.common.errors import require

WIDENING = (0.125, 0.25, 0.5, 1.0)  # shares of the box, tried in this order
MET = 0.1  # a prediction this share of the tolerance from the target meets it
ROUNDING = 1e-9  # of a place in the box, in ranges


def search_box(
    space: ParameterSpace, centre: Mapping[str, float], reach: float
) -> ParameterSpace:
    """Narrow the ranges to a box about `centre`; `reach` is half the width of the box, in ranges."""
    middle = np.array([float(centre[name]) for name in space.free])
    step = reach * (space.high - space.low)
    return replace(
        space,
        low=np.maximum(space.low, middle - step),
        high=np.minimum(space.high, middle + step),
    )


def propose(
    solutions: pd.DataFrame, model: Surrogate, study: Study, round_: int
) -> pd.DataFrame:
    """List the jobs of a round: the representative of `solutions` (feasible.csv), and neighbours around it.

    The neighbours are a Latin hypercube in the box in which the next round searches.
    """
    space, predicted, section = (
        study.parameters,
        list(study.targets.predicted),
        study.settings.refine,
    )
    best = solutions[solutions["representative"]].iloc[0]
    table = pd.DataFrame(jobs(section, round_), columns=["sample", "role", "seeds"])
    near = table["role"] == NEIGHBOUR
    for name in space.names:
        table[name] = float(best[name])
    if near.any() and space.dimensions:
        rng = np.random.default_rng(
            [study.settings.design.seed, PURPOSES["refined"], OF_A_ROUND * (round_ + 1)]
        )
        unit = lhsdesign(int(near.sum()), space.dimensions, rng=rng)
        table.loc[near, list(space.names)] = search_box(
            space, best, section.reach
        ).values(unit)
    table[predicted] = model.predict(table[list(space.names)].to_numpy(float))
    warning = best.get("warning", "")
    table["warning"] = np.where(near, "", "" if pd.isna(warning) else warning)
    return table[["sample", *space.names, "role", "seeds", *predicted, "warning"]]


def corrected(
    model: Surrogate, dataset: pd.DataFrame, box: ParameterSpace, targets: Targets
) -> tuple[Surrogate, np.ndarray, int]:
    """Shift a copy of the surrogate by the refined samples' mean residual inside a box, weighted by seeds.

    The refit follows the whole design and keeps a few percent of error where it matters. `round` of the dataset is
    empty for the design's samples. Also returns the offset (k,) and its number of samples; InputError without any.
    """
    added = dataset[dataset["round"].notna() & (dataset["status"] == "ok")]
    points = added[list(box.free)].to_numpy(float)
    slack = ROUNDING * (box.high - box.low)
    near = added[
        ((points >= box.low - slack) & (points <= box.high + slack)).all(axis=1)
    ]
    require(
        not near.empty,
        "runs",
        "samples of the rounds",
        0,
        "at least one that is ok, near the last proposal",
    )
    left = near[list(targets.names)].to_numpy(float) - model.predict(
        near[list(box.names)].to_numpy(float)
    )
    offset = np.average(left, axis=0, weights=near["n_seeds"].to_numpy(float))
    return model.shifted(offset), offset, len(near)


def search(
    model: Surrogate,
    dataset: pd.DataFrame,
    centre: Mapping[str, float],
    study: Study,
    support: Support | None = None,
) -> tuple[Surrogate, invert.Inversion]:
    """Correct a surrogate, refitted to `dataset`, near the last proposal `centre`, and search there.

    The search begins in an eighth of the box of `refine.reach` and widens it until the targets are met: of all suitable
    parameter sets, one near the last proposal is wanted, where the correction holds.
    """
    space, targets, section = study.parameters, study.targets, study.settings.refine
    reach, tolerance = section.reach, section.tolerance_percent / 100
    model, offset, count = corrected(
        model, dataset, search_box(space, centre, reach), targets
    )
    for share in WIDENING:
        box = search_box(space, centre, share * reach)
        inversion = invert.invert(
            model, box, targets, study.settings.miga, support=support
        )
        off = [
            inversion.summary["target_distance"][target.name] / target.whole
            for target in targets
        ]
        if max(off) < tolerance * MET:
            break
    near = {
        "reach": share * reach,
        "offset": dict(zip(targets.names, offset.tolist(), strict=True)),
    }
    return model, inversion._replace(
        summary=inversion.summary | near | {"offset_samples": count}
    )
